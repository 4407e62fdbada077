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

    await visitor.dragToZero(KNOB_BAND);
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
    assert.deepEqual(visitor.complaints, []);
  });
}
