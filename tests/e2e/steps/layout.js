import assert from "node:assert/strict";
import { artifact } from "../lib/artifacts.js";
import { FINAL_MILLIS } from "../lib/page.js";
import { isLit, region } from "../lib/pixels.js";
import { sessionOf, step } from "../lib/world.js";

/** Small laptops, projectors and desks; CSS pixels. */
const SIZES = [[900, 420], [1280, 800], [1920, 1080]];
/** Tablets and telephones; CSS pixels. */
const NARROW_SIZES = [[800, 900], [390, 800]];
/** A sample that is drawn quickly. */
const SAMPLE = "smoke_plume";
/** Names a session that there is not: its visitor gets another one, and a notice. */
const GONE = `#session=${"0".repeat(32)}`;
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

  step("layout: a notice is read beside the tools, at every size", async (arrive) => {
    for (const [width, height] of [...SIZES, ...NARROW_SIZES]) {
      const visitor = await arrive({ hash: GONE, width, height });
      await visitor.at("notice-mark").waitFor({ timeout: FINAL_MILLIS });
      const [notice, tools, picture] = await Promise.all([visitor.at("notice-mark"), visitor.page.locator(".view-tools"), visitor.at("viewport")].map((one) => one.boundingBox()));
      const apart = notice.x + notice.width <= tools.x || notice.y >= tools.y + tools.height;
      assert.ok(apart, `${width}x${height}: ${JSON.stringify({ notice, tools })}`);
      assert.ok(notice.x >= picture.x && notice.x + notice.width <= picture.x + picture.width && notice.y + notice.height <= picture.y + picture.height, "it lies within the picture");
      await visitor.at("notice-dismiss").click();
      await visitor.at("notice-mark").waitFor({ state: "detached" });
      await visitor.leave();
    }
  });

  step("layout: a narrow page shows one panel at a time over a picture that stays", async (arrive) => {
    const hash = await sessionOf(SAMPLE);
    for (const [width, height] of NARROW_SIZES) {
      const visitor = await arrive({ hash, width, height });
      const { size } = await visitor.picture();
      const { sent } = visitor;
      const within = async (id) => {
        const box = await visitor.at(id).boundingBox();
        assert.ok(box && box.x >= 0 && box.y >= 0 && box.x + box.width <= width && box.y + box.height <= height, `${id} within ${width}x${height}: ${JSON.stringify(box)}`);
      };
      for (const id of ["toggle-left", "toggle-right", "status-state", "status-latency", "help"]) await within(id);
      await visitor.at("toggle-left").click();
      await within("panel-left");
      await visitor.at("toggle-right").click();
      await within("panel-right");
      assert.equal(await visitor.at("panel-left").count(), 0, "one panel at a time");
      await visitor.at("toggle-right").click();
      assert.equal(await visitor.at("panel-right").count(), 0);
      await visitor.at("status-line").click();
      await within("statistics");
      await visitor.page.screenshot({ path: artifact(`page-${width}x${height}.png`) });
      assert.equal(await visitor.page.evaluate(() => document.documentElement.scrollWidth), width, "the page does not scroll");
      await visitor.flushed();
      assert.equal(visitor.sent, sent, "none of this asks for another picture");
      assert.equal((await visitor.look()).size, size);
      assert.deepEqual(visitor.complaints, []);
      await visitor.leave();
    }
  });
}
