import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { difference, isLit, meanLuma, pictureFromPng, region } from "../lib/pixels.js";
import { FINAL_MILLIS } from "../lib/page.js";
import { realScan } from "../lib/volumes.js";
import { step } from "../lib/world.js";

export function journeySteps() {
  step("journey: a real scan from upload to lossless still", async (arrive) => {
    const visitor = await arrive();
    await visitor.at("upload-input").setInputFiles({ name: "abdomen.nrrd", mimeType: "application/octet-stream", buffer: await realScan() });
    const tile = visitor.page.locator('[data-testid=upload][data-name="abdomen.nrrd"]');
    assert.match(await tile.getByTestId("dataset-facts").innerText(), /128 × 128 × 256 voxels/);
    await visitor.opening(() => tile.getByTestId("upload-explore").click());

    // One pass is enough here: a software device needs seconds for each.
    const samples = visitor.at("samples-per-pixel");
    await samples.fill("1");
    await samples.press("Enter");
    const opened = await visitor.picture();
    const lit = region(opened, isLit).share;
    assert.ok(lit > 0.08, `share of lit pixels: ${lit}`);

    await visitor.drag("viewport", [0.35, 0.5], [0.6, 0.5]);
    const turned = await visitor.picture();
    assert.ok(difference(opened, turned).mean > 2, "the camera moved");

    // Metal and bone are densest and the only white things: without the last two points they are gone.
    const white = (picture) => region(picture, (r, g, b) => Math.min(r, g, b) > 140).share;
    await visitor.dragToZero("tf-point-5");
    await visitor.dragToZero("tf-point-6");
    const thinned = await visitor.picture();
    assert.deepEqual([await visitor.data("tf-point-5", "opacity"), await visitor.data("tf-point-6", "opacity")].map(Number), [0, 0]);
    assert.ok(white(turned) > 0.002 && white(thinned) < 0.2 * white(turned), `white: ${white(turned)} to ${white(thinned)}`);
    await visitor.key("z");
    await visitor.key("z");
    assert.ok(difference(turned, await visitor.picture()).mean < 0.05, "two undos bring it back");

    await visitor.at("light-enabled-0").click();
    const dark = await visitor.picture();
    assert.ok(meanLuma(dark) < 0.8 * meanLuma(turned), `the key light is off: ${meanLuma(turned)} to ${meanLuma(dark)}`);

    await visitor.page.reload();
    const reloaded = await visitor.picture();
    assert.ok(difference(dark, reloaded).mean < 0.05, "the reload shows the same");

    const [download] = await Promise.all([visitor.page.waitForEvent("download", { timeout: FINAL_MILLIS }), visitor.at("save-still").click()]);
    const still = pictureFromPng(await readFile(await download.path()));
    assert.equal(difference(reloaded, still).most, 0, "the still is the picture, in every pixel");
    assert.deepEqual(visitor.complaints, []);
  });
}
