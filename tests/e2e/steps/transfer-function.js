import assert from "node:assert/strict";
import { isTeal, isMagenta } from "../lib/colours.js";
import { difference, region } from "../lib/pixels.js";
import { SHORT_MILLIS } from "../lib/page.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theLetter, world } from "../lib/world.js";

/** The band of the value 250: points 4 and 5. */
const KNOB_BAND = "tf-band-4";

const opacities = async (visitor) => [await visitor.data("tf-point-4", "opacity"), await visitor.data("tf-point-5", "opacity")].map(Number);

export function transferSteps() {
  step("transfer function: a drag takes matter away and one undo brings it back", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    const start = await visitor.picture();
    assert.ok(region(start, isMagenta).share > 0.01);
    const before = await opacities(visitor);
    assert.ok(before.every((opacity) => opacity > 0.9), `opacities: ${before}`);
    assert.ok(await visitor.at("undo").isDisabled());

    await visitor.dragToZero(KNOB_BAND);
    const without = await visitor.picture();
    assert.deepEqual(await opacities(visitor), [0, 0]);
    assert.equal(region(without, isMagenta).share, 0, "the knob is gone");
    const [teal, tealBefore] = [without, start].map((picture) => region(picture, isTeal).share);
    assert.ok(teal > tealBefore, `what was behind it is seen: ${tealBefore} to ${teal}`);

    await visitor.key("z");
    const undone = await visitor.picture();
    assert.deepEqual(await opacities(visitor), before);
    assert.ok(difference(start, undone).mean < 0.05, "the old picture is back");
    assert.ok(await visitor.at("undo").isDisabled(), "one drag was one step");

    await visitor.key("Shift+Z");
    assert.ok(difference(without, await visitor.picture()).mean < 0.05, "redo takes it away again");
    assert.deepEqual(visitor.complaints, []);
  });

  step("transfer function: the strip tells what an edit costs, and the histogram follows the clip box", async (arrive) => {
    const id = await theLetter();
    const hash = await sessionOf(id);
    const visitor = await arrive({ hash });
    await visitor.picture();
    // Values 0, 100 and 250: most of the volume is empty, the knob is small.
    const hit = visitor.at("tf-edit-cost-hit");
    const [low, high] = [Number(await visitor.at("window-low").inputValue()), Number(await visitor.at("window-high").inputValue())];
    const shareAt = async (value) => {
      const { width } = await hit.boundingBox();
      await hit.hover({ position: { x: Math.min(width - 1, ((value - low) / (high - low)) * width), y: 3 } });
      return Number(await hit.getAttribute("data-share"));
    };
    const [empty, body, knob] = [await shareAt(5), await shareAt(100), await shareAt(240)];
    assert.ok(empty > 0.8 && empty <= 1 && knob > 0 && knob < body && body < 0.35, `shares: ${empty}, ${body}, ${knob}`);
    assert.match(await visitor.page.getByText(/an edit at this value touches .* of the volume/).innerText(), /^\d+: an edit/);

    const whole = await visitor.at("tf-histogram").getAttribute("d");
    await visitor.at("tf-histogram-part").getByText("In view").click();
    assert.equal(await visitor.at("tf-histogram").getAttribute("d"), whole, "nothing is cut away yet");
    // No voxel of the letter is at the patient's left border: only the value 0 is left.
    const clip = (box) => world.server.json("PATCH", `sessions/${visitor.session()}/scene`, { clip: { box } });
    await clip([[0.9, 0, 0], [1, 1, 1]]);
    const border = await until("the histogram of the border", SHORT_MILLIS, async () => {
      const path = await visitor.at("tf-histogram").getAttribute("d");
      return path !== whole && path;
    });
    const peaks = (path) => {
      const heights = [...path.matchAll(/L[\d.]+ ([\d.]+)/g)].map(([, y]) => Number(y));
      return heights.filter((y, i) => y !== heights[i - 1] && y < Math.max(...heights)).length;
    };
    assert.deepEqual([peaks(whole), peaks(border)], [3, 1], "of three values one is left");
    await clip(null);
    await until("the whole histogram", SHORT_MILLIS, async () => (await visitor.at("tf-histogram").getAttribute("d")) === whole);
    assert.deepEqual(visitor.complaints, []);
  });
}
