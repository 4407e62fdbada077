import assert from "node:assert/strict";
import { artifact } from "../lib/artifacts.js";
import { isLit, region } from "../lib/pixels.js";
import { sessionOf, step } from "../lib/world.js";

/** Small laptops, projectors and desks; CSS pixels. */
const SIZES = [[900, 420], [1280, 800], [1920, 1080]];
/** A sample that is drawn quickly. */
const SAMPLE = "smoke_plume";
/** What must lie within the page at every size. */
const CORNERS = ["toggle-left", "toggle-right", "status-state", "status-resolution", "orientation-cube", "save-still"];

export function layoutSteps() {
  step("layout: everything lies within the page at usual sizes", async (arrive) => {
    const hash = await sessionOf(SAMPLE);
    for (const [width, height] of SIZES) {
      const visitor = await arrive({ hash, width, height });
      const picture = await visitor.picture();
      await visitor.page.screenshot({ path: artifact(`page-${width}x${height}.png`) });
      assert.ok(region(picture, isLit).share > 0.03, `${width}: the sample is seen`);
      for (const id of CORNERS) {
        const box = await visitor.at(id).boundingBox();
        const inside = box && box.x >= 0 && box.y >= 0 && box.x + box.width <= width && box.y + box.height <= height;
        assert.ok(inside, `${id} within ${width}x${height}: ${JSON.stringify(box)}`);
      }
      const scrolled = await visitor.page.evaluate(() => [document.documentElement.scrollWidth, document.documentElement.scrollHeight]);
      assert.deepEqual(scrolled, [width, height], "the page does not scroll");
      assert.equal(picture.size, `${picture.width}x${picture.height}`);
      assert.deepEqual(visitor.complaints, []);
      await visitor.leave();
    }
  });
}
