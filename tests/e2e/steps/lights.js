import assert from "node:assert/strict";
import { meanLuma } from "../lib/pixels.js";
import { sessionOf, step, theBall } from "../lib/world.js";

/** Luma of the right half over that of the left half. */
const rightOverLeft = (picture) => meanLuma(picture, (x) => x >= picture.width / 2) / meanLuma(picture, (x) => x < picture.width / 2);

export function lightSteps() {
  step("lights: the lit side follows the light, rigs and switches work", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theBall()) });
    await visitor.picture();
    await visitor.at("light-select-0").click();

    await visitor.drag("light-direction", [0.5, 0.5], [0.25, 0.5]);
    const fromLeft = await visitor.picture();
    assert.ok(rightOverLeft(fromLeft) < 0.9, `lit from the left: ${rightOverLeft(fromLeft)}`);

    await visitor.drag("light-direction", [0.25, 0.5], [0.75, 0.5]);
    const fromRight = await visitor.picture();
    assert.ok(rightOverLeft(fromRight) > 1.15, `lit from the right: ${rightOverLeft(fromRight)}`);

    await visitor.at("light-enabled-0").click();
    const off = await visitor.picture();
    assert.equal(await visitor.data("light-0", "enabled"), "false");
    assert.ok(meanLuma(off) < 0.8 * meanLuma(fromRight), `darker without it: ${meanLuma(fromRight)} to ${meanLuma(off)}`);

    await visitor.at("rig-flat").click();
    const flat = await visitor.picture();
    assert.equal(await visitor.page.locator("[data-testid=lights] li").count(), 2);
    assert.ok(Math.abs(rightOverLeft(flat) - 1) < 0.05, `even light: ${rightOverLeft(flat)}`);
    assert.ok(meanLuma(flat) > meanLuma(off), "brighter than with the key light off");

    // Three steps back: the rig, the switch, the second drag.
    for (let undo = 0; undo < 3; undo += 1) await visitor.key("z");
    const back = await visitor.picture();
    assert.ok(rightOverLeft(back) < 0.9, `lit from the left again: ${rightOverLeft(back)}`);
    assert.deepEqual(visitor.complaints, []);
  });
}
