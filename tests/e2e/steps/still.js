import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { FINAL_MILLIS } from "../lib/page.js";
import { difference, isLit, pictureFromPng, region } from "../lib/pixels.js";
import { sessionOf, step, theLetter, world } from "../lib/world.js";

export function stillSteps() {
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
