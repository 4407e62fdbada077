import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { FINAL_MILLIS, SHORT_MILLIS } from "../lib/page.js";
import { difference, isLit, pictureFromPng, region } from "../lib/pixels.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theLetter, world } from "../lib/world.js";

/** The chunks of a PNG: `[type, bytes]`. */
function chunksOf(png) {
  const chunks = [];
  for (let at = 8; at < png.length; at += 12 + png.readUInt32BE(at)) {
    chunks.push([png.toString("latin1", at + 4, at + 8), png.subarray(at + 8, at + 8 + png.readUInt32BE(at))]);
  }
  return chunks;
}

/** Types a number into a field of the dialog. */
const type = (visitor, field, number) => visitor.at(`turntable-${field}`).fill(String(number));

export function turntableSteps() {
  step("turntable: chosen, drawn, downloaded; a long one is cancelled", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()), width: 1100, height: 800 });
    await visitor.picture();
    await visitor.key("t");
    await until("pictures of the way", FINAL_MILLIS, async () => (await visitor.page.locator("[data-testid=turntable-picture][data-drawn=true]").count()) === 4);

    await type(visitor, "seconds", 0);
    assert.match(await visitor.at("turntable-words").innerText(), /no picture/);
    assert.equal(await visitor.at("turntable-begin").isDisabled(), true);
    for (const [field, number] of [["turns", -1], ["seconds", 0.5], ["rate", 16], ["width", 96], ["height", 64], ["samples", 1]]) await type(visitor, field, number);
    assert.match(await visitor.at("turntable-words").innerText(), /8 pictures of 96 × 64, one every 45°/);
    await visitor.at("turntable-begin").click();
    await until("the turntable is done", FINAL_MILLIS, async () => (await visitor.data("turntable-job", "state")) === "done");
    const [download] = await Promise.all([visitor.page.waitForEvent("download"), visitor.at("turntable-download").click()]);
    assert.match(download.suggestedFilename(), /^letter.*turntable\.png$/);
    const png = await readFile(await download.path());
    const chunks = chunksOf(png);
    const [, control] = chunks.find(([name]) => name === "acTL");
    assert.deepEqual([control.readUInt32BE(0), control.readUInt32BE(4)], [8, 0], "eight pictures, played again and again");
    assert.equal(chunks.filter(([name]) => name === "fcTL").length, 8);
    const first = pictureFromPng(png);
    assert.deepEqual([first.width, first.height], [96, 64]);
    assert.ok(region(first, isLit).share > 0.05);

    // The browser takes it for an animation: it decodes to eight different pictures.
    const shown = await visitor.page.evaluate(async () => {
      const data = await (await fetch(document.querySelector(".turntable-result").src)).arrayBuffer();
      const decoder = new globalThis.ImageDecoder({ data, type: "image/png" });
      await decoder.tracks.ready;
      return { frames: decoder.tracks.selectedTrack.frameCount, animated: decoder.tracks.selectedTrack.animated };
    }).catch(() => null);
    // Only secure places have the decoder; a loopback address is one.
    if (shown) assert.deepEqual(shown, { frames: 8, animated: true });

    // The first picture is the view on screen, as the service draws it.
    const { scene } = await world.server.json("GET", `sessions/${visitor.session()}`);
    const copy = await world.server.json("POST", "sessions", { scene: { ...scene, sampling: { ...scene.sampling, samples_per_pixel: 1 } } });
    const still = pictureFromPng(await (await fetch(`${world.server.origin}/api/v1/sessions/${copy.id}/snapshot?width=96&height=64`)).arrayBuffer());
    assert.equal(difference(first, still).most, 0);

    await visitor.at("turntable-another").click();
    for (const [field, number] of [["seconds", 60], ["rate", 24], ["width", 1600], ["height", 1200], ["samples", 4096]]) await type(visitor, field, number);
    const [answer] = await Promise.all([
      visitor.page.waitForResponse((response) => response.url().endsWith("/exports")),
      visitor.at("turntable-begin").click(),
    ]);
    const { id } = await answer.json();
    await until("it is drawn", SHORT_MILLIS, async () => (await visitor.data("turntable-job", "state")) === "drawing");
    await visitor.at("turntable-cancel").click();
    await visitor.at("turntable-begin").waitFor();
    await until("it is stopped", SHORT_MILLIS, async () => (await fetch(`${world.server.origin}/api/v1/exports/${id}`)).status === 404);
    // Nothing of it is left to do: the next picture comes as always.
    await visitor.page.keyboard.press("Escape");
    await visitor.at("turntable-begin").waitFor({ state: "detached" });
    await visitor.key("ArrowRight");
    await visitor.picture();
    assert.deepEqual(visitor.complaints.filter((text) => !/404/.test(text)), []);
  });

  step("film: views kept, put in order, timed, drawn; its ends are the views", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()), width: 1100, height: 800 });
    await visitor.picture();
    await visitor.key("v");
    await visitor.key("ArrowRight");
    await visitor.key("ArrowRight");
    await visitor.picture();
    await visitor.key("v");
    await visitor.key("2");
    await visitor.picture();
    await visitor.key("t");
    await visitor.at("film-add").click();
    await until("pictures of the views", FINAL_MILLIS, async () => (await visitor.page.locator("[data-testid=turntable-picture][data-drawn=true]").count()) === 3);

    // The last view first, and the one that was first not at all.
    await visitor.at("film-up-3").click();
    await visitor.at("film-up-2").click();
    await visitor.at("film-remove-2").click();
    assert.equal(await visitor.page.locator("[data-testid=film-views] > li").count(), 2);
    await visitor.at("film-seconds-2").fill("0.5");
    for (const [field, number] of [["rate", 8], ["width", 96], ["height", 64], ["samples", 1]]) await type(visitor, field, number);
    assert.match(await visitor.at("turntable-words").innerText(), /5 pictures of 96 × 64 in 0.5 s/);
    const [asked] = await Promise.all([
      visitor.page.waitForRequest((request) => request.method() === "POST" && request.url().endsWith("/exports")),
      visitor.at("turntable-begin").click(),
    ]);
    const { keys } = asked.postDataJSON();
    assert.deepEqual(keys.map(({ seconds }) => seconds), [0, 0.5]);
    await until("the film is done", FINAL_MILLIS, async () => (await visitor.data("turntable-job", "state")) === "done");
    const [download] = await Promise.all([visitor.page.waitForEvent("download"), visitor.at("turntable-download").click()]);
    assert.match(download.suggestedFilename(), /^letter.*film\.png$/);
    const png = await readFile(await download.path());
    assert.equal(chunksOf(png).filter(([name]) => name === "fcTL").length, 5);

    // It begins with the view that is on screen, as the service draws it.
    const { scene } = await world.server.json("GET", `sessions/${visitor.session()}`);
    const copy = await world.server.json("POST", "sessions", { scene: { ...scene, camera: keys[0].camera, sampling: { ...scene.sampling, samples_per_pixel: 1 } } });
    const still = pictureFromPng(await (await fetch(`${world.server.origin}/api/v1/sessions/${copy.id}/snapshot?width=96&height=64`)).arrayBuffer());
    assert.equal(difference(pictureFromPng(png), still).most, 0);

    // Views outlast a reload.
    await visitor.page.reload();
    await visitor.picture();
    await visitor.key("v");
    await visitor.key("t");
    await visitor.at("film-view-3").waitFor();
    await visitor.at("film-go-2").click();
    await visitor.at("film-views").waitFor({ state: "detached" });
    await visitor.picture();
    assert.deepEqual(visitor.complaints, []);
  });
}
