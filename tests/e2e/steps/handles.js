import assert from "node:assert/strict";
import { difference, isLit, meanLuma, region } from "../lib/pixels.js";
import { sessionOf, step, theBall, theLetter } from "../lib/world.js";

/** Drags a handle by this much, pixels. */
async function pull(visitor, id, dx, dy) {
  const { x, y, width, height } = await visitor.at(id).boundingBox();
  const [px, py] = [x + width / 2, y + height / 2];
  await visitor.page.mouse.move(px, py);
  await visitor.page.mouse.down();
  await visitor.page.mouse.move(px + dx / 2, py + dy / 2);
  await visitor.page.mouse.move(px + dx, py + dy);
  await visitor.page.mouse.up();
}

export function handleSteps() {
  step("handles: a face of the clip box is pulled in the picture, by mouse and by keys", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    const start = await visitor.picture();
    await visitor.at("viewport").focus();
    await visitor.key("c");
    // The upper face, halfway down: the tower is cut, the foot stays.
    const upper = "clip-face-z-to";
    const { height } = await visitor.at("viewport").boundingBox();
    await pull(visitor, upper, 0, 0.3 * height);
    const cut = await visitor.picture();
    const share = Number(await visitor.at(upper).getAttribute("aria-valuenow"));
    assert.ok(share > 0.2 && share < 0.8, `kept up to ${share}`);
    const top = (picture) => region(picture, isLit).y;
    assert.ok(top(cut) > top(start) + 0.01, `what is left lies lower: ${top(start)} to ${top(cut)}`);
    const followed = await visitor.at(upper).boundingBox();
    await visitor.key("z");
    await visitor.picture();
    const back = await visitor.at(upper).boundingBox();
    assert.ok(Math.abs(followed.y - back.y - 0.3 * height) < 3, `the face followed the pointer: ${back.y} to ${followed.y}`);
    assert.equal(await visitor.data("undo", "disabled"), "true", "one drag was one step");

    await visitor.at(upper).focus();
    await visitor.key("Shift+ArrowDown");
    await visitor.key("ArrowDown");
    await visitor.picture();
    assert.equal(await visitor.at(upper).getAttribute("aria-valuetext"), "89 %");
    assert.deepEqual(visitor.complaints, []);
  });

  step("handles: a light is moved in the picture", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theBall()) });
    await visitor.picture();
    await visitor.at("rig-studio").click();
    await visitor.at("light-select-0").click();
    for (let press = 0; press < 12; press += 1) await visitor.key("-");
    const start = await visitor.picture();
    const { x, y } = await visitor.at("light-handle").boundingBox();
    await pull(visitor, "light-handle", 60, 40);
    const moved = await visitor.picture();
    const to = await visitor.at("light-handle").boundingBox();
    assert.ok(Math.hypot(to.x - x - 60, to.y - y - 40) < 2, `the light follows the pointer: ${x}, ${y} to ${to.x}, ${to.y}`);
    assert.ok(difference(start, moved).mean > 0.02, "and the picture the light");
    assert.deepEqual(visitor.complaints, []);
  });

  step("window and level: dragged in the picture of a projection, one undo step", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theBall()) });
    await visitor.picture();
    await visitor.at("rendering-mode").selectOption("average");
    const start = await visitor.picture();
    await visitor.at("viewport").focus();
    await visitor.key("w");
    await visitor.drag("viewport", [0.5, 0.35], [0.5, 0.6]);
    const lower = await visitor.picture();
    assert.ok(meanLuma(lower) > 1.2 * meanLuma(start), `downwards brightens: ${meanLuma(start)} to ${meanLuma(lower)}`);
    await visitor.at("viewport").focus();
    await visitor.key("z");
    assert.ok(difference(start, await visitor.picture()).mean < 0.05, "one step back");
    await visitor.key("ArrowUp");
    assert.ok(meanLuma(await visitor.picture()) < meanLuma(start), "the upper arrow raises the level");
    await visitor.key("w");
    await visitor.key("ArrowUp");
    await visitor.picture();
    assert.equal(await visitor.at("window-readout").count(), 0);
    assert.deepEqual(visitor.complaints, []);
  });
}
