import assert from "node:assert/strict";
import { isLit, difference, meanLuma, pictureFromPng, region } from "../lib/pixels.js";
import { realScan } from "../lib/volumes.js";
import { step, world } from "../lib/world.js";

export function journeySteps() {
  step("journey: a real scan from upload to lossless still", async (arrive, context) => {
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

    // The stent's metal and the bones are the densest: without the last two points the rest stays.
    await visitor.drag("tf-point-6", [0.5, 0.5], [0.5, 20], 8);
    await visitor.drag("tf-point-5", [0.5, 0.5], [0.5, 20], 8);
    const thinned = await visitor.picture();
    assert.equal(Number(await visitor.data("tf-point-5", "opacity")), 0);
    const thin = region(thinned, isLit).share;
    assert.ok(thin < 0.8 * region(turned, isLit).share && thin > 0.005, `less is seen: ${region(turned, isLit).share} to ${thin}`);
    await visitor.key("z");
    await visitor.key("z");
    assert.ok(difference(turned, await visitor.picture()).mean < 0.05, "undo brings it back");

    await visitor.at("light-enabled-0").click();
    const dark = await visitor.picture();
    assert.ok(meanLuma(dark) < 0.8 * meanLuma(turned), `the key light is off: ${meanLuma(turned)} to ${meanLuma(dark)}`);

    await visitor.page.reload();
    const reloaded = await visitor.picture();
    assert.ok(difference(dark, reloaded).mean < 0.05, "the reload shows the same");

    const still = async () => {
      const answer = await fetch(`${world.server.origin}/api/v1/sessions/${visitor.session()}/snapshot?width=${reloaded.width}&height=${reloaded.height}`);
      return pictureFromPng(await answer.arrayBuffer());
    };
    const { x: _ } = context;
    await visitor.at("save-still").click();
    await visitor.page.waitForEvent("download", { timeout: 60_000 });
    assert.equal(difference(reloaded, await still()).most, 0, "the still is the picture, in every pixel");
    assert.deepEqual(visitor.complaints, []);
  });
}
