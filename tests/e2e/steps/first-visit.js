import assert from "node:assert/strict";
import { cut, difference, isLit, meanLuma, pictureFromPng, region } from "../lib/pixels.js";
import { until } from "../lib/wait.js";
import { step } from "../lib/world.js";

/** A first picture is there within this time of asking for the page, milliseconds. A GPU needs far less; a busy software device does not. */
const FIRST_PICTURE_MILLIS = 30_000;

export function firstVisitSteps() {
  step("first visit: a lit sample appears, and nothing complains", async (arrive, context) => {
    const asked = Date.now();
    const visitor = await arrive();
    const picture = await until("a picture", FIRST_PICTURE_MILLIS, async () => {
      const now = await visitor.look();
      return now.frame >= 0 && now;
    });
    context.diagnostic(`first picture after ${Date.now() - asked} ms`);

    const { share, x, y } = region(picture, isLit);
    assert.ok(share > 0.1, `share of lit pixels: ${share}`);
    assert.ok(meanLuma(picture) > 15, `mean luma: ${meanLuma(picture)}`);
    assert.ok(Math.abs(x - 0.5) < 0.2 && Math.abs(y - 0.5) < 0.2, `the sample lies in the middle: ${x}, ${y}`);

    // What a person sees is the canvas: its middle is compared with a photograph of the page.
    const box = await visitor.at("viewport").boundingBox();
    const middle = [[0.2, 0.25], [0.8, 0.75]];
    const [canvas, seen] = await until("page and canvas with the same picture", FIRST_PICTURE_MILLIS, async () => {
      const before = await visitor.look();
      const photograph = pictureFromPng(await visitor.page.screenshot({ clip: box }));
      return (await visitor.look()).frame === before.frame && [before, photograph];
    });
    assert.equal(difference(cut(canvas, ...middle), cut(seen, ...middle)).most, 0, "the page shows the canvas");

    assert.match(await visitor.at("status-state").innerText(), /moving|refining|final/);
    assert.ok(await visitor.page.locator("[data-testid=datasets-samples] li").count() >= 5, "samples are offered");
    assert.deepEqual(visitor.complaints, []);
  });
}
