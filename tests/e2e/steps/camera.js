import assert from "node:assert/strict";
import { isTeal, isMagenta } from "../lib/colours.js";
import { difference, isLit, region } from "../lib/pixels.js";
import { sessionOf, step, theLetter } from "../lib/world.js";

/** Two pictures of one view: the mean channel differs by less. */
const SAME = 0.05;

const knobOf = (picture) => region(picture, isMagenta);

export function cameraSteps() {
  step("camera: the front follows the mouse, the wheel zooms, keys turn, R goes back", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    const start = await visitor.picture();
    const knob = knobOf(start);

    await visitor.drag("viewport", [0.4, 0.5], [0.6, 0.5]);
    const turned = await visitor.picture();
    assert.ok(knobOf(turned).x > knob.x + 0.08, `knob: ${knob.x} to ${knobOf(turned).x}`);
    assert.ok(Math.abs(knobOf(turned).y - knob.y) < 0.05, "it turns about the vertical axis");

    await visitor.key("r");
    assert.ok(difference(start, await visitor.picture()).mean < SAME, "R goes back");

    await visitor.drag("viewport", [0.5, 0.6], [0.5, 0.45]);
    const tipped = await visitor.picture();
    assert.ok(knobOf(tipped).y < knob.y - 0.04, `knob goes up: ${knob.y} to ${knobOf(tipped).y}`);

    await visitor.key("r");
    await visitor.at("viewport").hover();
    await visitor.page.mouse.wheel(0, -300);
    const near = await visitor.picture();
    const [before, after] = [start, near].map((picture) => region(picture, isLit).share);
    assert.ok(after > 1.25 * before, `nearer is larger: ${before} to ${after}`);

    await visitor.key("r");
    for (let press = 0; press < 4; press += 1) await visitor.key("ArrowLeft");
    const left = await visitor.picture();
    assert.ok(knobOf(left).x < knob.x - 0.05, `knob goes left: ${knob.x} to ${knobOf(left).x}`);

    // From the patient's left the foot is seen from its end, and the knob points to the left.
    await visitor.key("3");
    const side = await visitor.picture();
    assert.ok(knobOf(side).x < region(side, isTeal).x - 0.1, "the front is on the left, seen from the left");

    await visitor.key("r");
    assert.ok(difference(start, await visitor.picture()).mean < SAME, "R goes back");
    assert.deepEqual(visitor.complaints, []);
  });
}
