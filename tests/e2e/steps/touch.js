import assert from "node:assert/strict";
import { isMagenta } from "../lib/colours.js";
import { isLit, region } from "../lib/pixels.js";
import { sessionOf, step, theLetter } from "../lib/world.js";

export function touchSteps() {
  step("touch: one finger turns, two zoom, points and panels follow a finger", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()), hasTouch: true });
    const start = await visitor.picture();
    await visitor.fingers("viewport", [[[0.4, 0.5], [0.6, 0.5]]]);
    const turned = await visitor.picture();
    assert.ok(region(turned, isMagenta).x > region(start, isMagenta).x + 0.08, "the front follows the finger");

    await visitor.at("reset-view").tap();
    await visitor.picture();
    await visitor.fingers("viewport", [[[0.45, 0.5], [0.35, 0.5]], [[0.55, 0.5], [0.65, 0.5]]]);
    const near = await visitor.picture();
    assert.ok(region(near, isLit).share > 1.3 * region(start, isLit).share, "two fingers bring it nearer");

    // A tap and a finger on the point of the largest value; its opacity falls.
    const before = Number(await visitor.data("tf-point-5", "opacity"));
    await visitor.at("tf-point-5").tap();
    await visitor.fingers("tf-point-5", [[[0.5, 0.5], [0.5, 4]]]);
    await visitor.picture();
    assert.ok(Number(await visitor.data("tf-point-5", "opacity")) < before - 0.1, "the point follows the finger");

    await visitor.fingers("tf-editor", [[[0.4, 0.6], [0.2, 0.6]], [[0.6, 0.6], [0.8, 0.6]]]);
    const [low, high] = (await visitor.data("tf-editor", "window")).split(" ").map(Number);
    assert.ok(low > 0.1 && high < 0.9 && low < 0.5 && high > 0.5, `two fingers zoom the values: ${low} to ${high}`);
    assert.deepEqual(visitor.complaints, []);
  });
}
