import assert from "node:assert/strict";
import { isGreen, isViolet } from "../lib/colours.js";
import { difference, region } from "../lib/pixels.js";
import { sessionOf, step, theLetter } from "../lib/world.js";

/** The band of the value 250: points 4 and 5. */
const KNOB_BAND = "tf-band-4";

const opacities = async (visitor) => [await visitor.data("tf-point-4", "opacity"), await visitor.data("tf-point-5", "opacity")].map(Number);

export function transferSteps() {
  step("transfer function: a drag takes matter away and one undo brings it back", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    const start = await visitor.picture();
    assert.ok(region(start, isViolet).share > 0.01);
    const before = await opacities(visitor);
    assert.ok(before.every((opacity) => opacity > 0.9), `opacities: ${before}`);
    assert.ok(await visitor.at("undo").isDisabled());

    await visitor.drag(KNOB_BAND, [0.5, 0.5], [0.5, 2], 8);
    const without = await visitor.picture();
    assert.deepEqual(await opacities(visitor), [0, 0]);
    assert.equal(region(without, isViolet).share, 0, "the knob is gone");
    const [green, greenBefore] = [without, start].map((picture) => region(picture, isGreen).share);
    assert.ok(green > greenBefore, `what was behind it is seen: ${greenBefore} to ${green}`);

    await visitor.key("z");
    const undone = await visitor.picture();
    assert.deepEqual(await opacities(visitor), before);
    assert.ok(difference(start, undone).mean < 0.05, "the old picture is back");
    assert.ok(await visitor.at("undo").isDisabled(), "one drag was one step");

    await visitor.key("Shift+Z");
    assert.ok(difference(without, await visitor.picture()).mean < 0.05, "redo takes it away again");

    // A single point, moved to the right: its value grows, its opacity stays.
    const point = Number(await visitor.data("tf-point-3", "s"));
    await visitor.key("z");
    await visitor.picture();
    await visitor.drag("tf-point-2", [0.5, 0.5], [-4, 0.5]);
    await visitor.picture();
    assert.ok(Number(await visitor.data("tf-point-2", "s")) < point, "points keep their order");
    assert.deepEqual(visitor.complaints, []);
  });
}
