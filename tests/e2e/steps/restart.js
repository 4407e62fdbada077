import assert from "node:assert/strict";
import { isMagenta } from "../lib/colours.js";
import { FINAL_MILLIS } from "../lib/page.js";
import { difference, meanLuma, pictureFromPng, region } from "../lib/pixels.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theLetter, world } from "../lib/world.js";

/** The page notices within this time that the service is gone, milliseconds. */
const NOTICE_MILLIS = 5000;

export function restartSteps() {
  step("restart: the page says that the service is away, and comes back by itself", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    await visitor.drag("viewport", [0.4, 0.5], [0.55, 0.45]);
    await visitor.dragToZero("tf-band-4");
    const before = await visitor.picture();
    const photograph = async () => pictureFromPng(await visitor.page.screenshot({ clip: await visitor.at("viewport").boundingBox() }));
    const bright = meanLuma(await photograph());

    await world.server.kill();
    await until("the page is offline", NOTICE_MILLIS, async () => (await visitor.data("viewport", "state")) === "offline");
    assert.match(await visitor.at("offline-mark").innerText(), /connection|service|reach/i);
    assert.match(await visitor.at("status-state").innerText(), /offline/);
    assert.equal(difference(before, await visitor.look()).most, 0, "the picture stays");
    await until("the picture is dimmed", NOTICE_MILLIS, async () => meanLuma(await photograph()) < 0.9 * bright);

    await world.server.start();
    await until("the page is back", FINAL_MILLIS, async () => (await visitor.data("viewport", "state")) !== "offline");
    const after = await visitor.picture();
    assert.ok(difference(before, after).mean < 0.05, "the same scene from the same side");
    assert.equal(region(after, isMagenta).share, 0, "the edit is kept");
    assert.equal(await visitor.at("offline-mark").count(), 0);
    assert.ok(meanLuma(await photograph()) > 0.95 * bright, "no longer dimmed");
  });
}
