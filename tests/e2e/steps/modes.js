import assert from "node:assert/strict";
import { cut, difference, region } from "../lib/pixels.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theBall } from "../lib/world.js";

/** Pixels that are no grey. */
const isColoured = (r, g, b) => Math.max(r, g, b) - Math.min(r, g, b) > 2;
const isWhite = (r, g, b) => Math.min(r, g, b) > 245;
const middleOf = (picture) => cut(picture, [0.48, 0.48], [0.52, 0.52]);

export function modeSteps() {
  step("modes: projection and slice show values as greys, the pointer reads them", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theBall()) });
    const lit = await visitor.picture();

    await visitor.at("rendering-mode").selectOption("maximum");
    const maximum = await visitor.picture();
    assert.ok(difference(lit, maximum).mean > 1, "another picture");
    assert.equal(region(middleOf(maximum), isWhite).share, 1, "the ball holds the largest value");

    const box = await visitor.at("viewport").boundingBox();
    await visitor.page.mouse.move(box.x + box.width / 2 - 5, box.y + box.height / 2);
    await visitor.page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await until("the value under the pointer", 5000, async () => (await visitor.at("probe-value").innerText().catch(() => "")) === "250");

    await visitor.at("rendering-mode").selectOption("slice");
    await visitor.at("slice-plane").selectOption("1");
    const slice = await visitor.picture();
    assert.equal(region(middleOf(slice), isColoured).share, 0, "a slice through the ball is grey");
    assert.equal(region(middleOf(slice), isWhite).share, 1, "and white in its middle");

    // The volume has 40 slices.
    const number = async () => Number((await visitor.at("slice-place").innerText()).match(/slice (\d+) of 40/)[1]);
    const before = await number();
    await visitor.at("viewport").focus();
    await visitor.key("PageUp");
    await visitor.picture();
    assert.equal(await number(), before + 1, "Page Up goes to the next slice");
    await visitor.key("z");
    await visitor.picture();

    await visitor.at("rendering-mode").selectOption("volume");
    await visitor.picture();
    await visitor.key("z");
    assert.ok(difference(slice, await visitor.picture()).mean < 0.05, "undo shows the slice again");
    assert.deepEqual(visitor.complaints, []);
  });
}
