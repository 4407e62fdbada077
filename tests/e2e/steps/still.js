import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { FINAL_MILLIS } from "../lib/page.js";
import { difference, hashOf, isLit, pictureFromPng, region } from "../lib/pixels.js";
import { sessionOf, step, theLetter, world } from "../lib/world.js";

/** The exact picture is to be begun so long after the last input, beside the time that pictures on the way to it are drawn, milliseconds. */
const PROMISED_MILLIS = 250;

export function stillSteps() {
  step("still: after a drag the exact picture follows, and no older one counts", async (arrive, context) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    await visitor.picture();
    // When the page sent each input, and when the canvas came to show each picture.
    await visitor.page.evaluate(() => {
      const canvas = document.querySelector("[data-testid=viewport]");
      globalThis.shownPictures = [];
      new MutationObserver(() => {
        const { frame, seq, state } = canvas.dataset;
        const last = globalThis.shownPictures.at(-1);
        if (last?.frame !== frame || last?.state !== state) globalThis.shownPictures.push({ at: performance.now(), frame, seq: Number(seq), state });
      }).observe(canvas, { attributes: true });
      globalThis.lastInput = 0;
      const send = WebSocket.prototype.send;
      WebSocket.prototype.send = function (data) {
        if (typeof data === "string" && /"seq"/.test(data)) globalThis.lastInput = performance.now();
        return send.call(this, data);
      };
    });
    const waits = [];
    for (const [from, to] of [[[0.4, 0.5], [0.6, 0.45]], [[0.6, 0.5], [0.45, 0.55]], [[0.5, 0.4], [0.42, 0.6]]]) {
      await visitor.drag("viewport", from, to);
      const shown = await visitor.picture();
      const { pictures, lastInput } = await visitor.page.evaluate(() => ({ pictures: globalThis.shownPictures.splice(0), lastInput: globalThis.lastInput }));
      const final = pictures.findLast(({ state }) => state === "final");
      assert.ok(final.seq >= visitor.sent, "the exact picture shows the last input");
      const header = visitor.headers.get(Number(final.frame));
      const drawing = (header.render_micros + header.encode_micros) / 1000;
      // By the service's own clock: from the input's arrival to the beginning of the exact picture, without the
      // reduced ones drawn before. (Refining ones were begun with it.)
      const earlier = [...visitor.headers.values()].filter(({ seq, queue_micros }) => seq === header.seq && queue_micros < header.queue_micros);
      const meanwhile = earlier.reduce((sum, { render_micros }) => sum + render_micros, 0);
      waits.push({ all: final.at - lastInput, drawing, waited: (header.queue_micros - meanwhile) / 1000 });

      // Its pixels are those of the service's own picture of that epoch, and of no other.
      await Promise.all([visitor.page.waitForEvent("download", { timeout: FINAL_MILLIS }), visitor.key("s")]);
      const address = `${world.server.origin}/api/v1/sessions/${visitor.session()}/snapshot?width=${shown.width}&height=${shown.height}`;
      const newest = await world.server.json("GET", `sessions/${visitor.session()}`);
      const answer = await fetch(`${address}&epoch=${newest.epoch}`);
      assert.equal(answer.headers.get("tyndall-epoch"), String(newest.epoch));
      assert.equal(hashOf(pictureFromPng(await answer.arrayBuffer())), hashOf(shown));
      assert.equal((await fetch(`${address}&epoch=${newest.epoch - 1}`)).status, 409, "a still of an older epoch is refused");
    }
    for (const { all, drawing, waited } of waits) {
      context.diagnostic(`exact ${all.toFixed(0)} ms after the last input: ${drawing.toFixed(0)} ms drawing and encoding, ${(all - drawing).toFixed(0)} ms beside; the service waited ${waited.toFixed(0)} ms`);
    }
    // Of three, so that one stall of a busy machine does not count.
    const [, median] = waits.map(({ waited }) => waited).sort((a, b) => a - b);
    assert.ok(median <= PROMISED_MILLIS, `the exact picture is begun ${median.toFixed(0)} ms after the last input`);
    assert.deepEqual(visitor.complaints, []);
  });

  step("still: the final picture is the server's PNG, in every pixel", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    const start = await visitor.picture();
    await visitor.drag("viewport", [0.4, 0.5], [0.5, 0.4]);
    const shown = await visitor.picture();
    assert.equal(shown.size, `${shown.width}x${shown.height}`, "drawn at the canvas's own pixels");
    assert.ok(region(shown, isLit).share > 0.1);

    const [download] = await Promise.all([visitor.page.waitForEvent("download", { timeout: FINAL_MILLIS }), visitor.at("save-still").click()]);
    assert.match(download.suggestedFilename(), /^letter-\d{8}-\d{6}\.png$/);
    const saved = pictureFromPng(await readFile(await download.path()));
    assert.equal(difference(shown, saved).most, 0, "the saved still");

    const answer = await fetch(`${world.server.origin}/api/v1/sessions/${visitor.session()}/snapshot?width=${shown.width}&height=${shown.height}`);
    assert.equal(answer.headers.get("content-type"), "image/png");
    const still = pictureFromPng(await answer.arrayBuffer());
    assert.equal(difference(shown, still).most, 0, "the snapshot of the interface");
    assert.ok(difference(start, still).mean > 1, "it is the view of this moment");
    assert.deepEqual(visitor.complaints, []);
  });
}
