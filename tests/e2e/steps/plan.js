import assert from "node:assert/strict";
import { difference, meanLuma } from "../lib/pixels.js";
import { pause } from "../lib/wait.js";
import { sessionOf, step, theLetter } from "../lib/world.js";

/** A service that draws for nothing would have sent a picture in this time, milliseconds. */
const QUIET_MILLIS = 1500;

const ran = (report, name) => report.plan.some(({ pass, runs }) => pass === name && runs);
/** What the statistics show. */
const runs = (visitor, pass) => visitor.data(`plan-${pass}`, "runs");

export function planSteps() {
  step("plan: exposure costs tone mapping alone, and nothing runs when nothing changed", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    await visitor.picture();
    await visitor.key("i");
    await visitor.at("statistics").waitFor();
    const start = await visitor.picture();

    visitor.reports.length = 0;
    const exposure = visitor.at("exposure");
    await exposure.fill("1");
    await exposure.press("Enter");
    const brighter = await visitor.picture();
    assert.ok(meanLuma(brighter) > 1.2 * meanLuma(start), `a stop more: ${meanLuma(start)} to ${meanLuma(brighter)}`);
    assert.ok(visitor.reports.length > 0);
    assert.ok(!visitor.reports.some((report) => ran(report, "ray_cast")), "no ray is cast");
    assert.ok(visitor.reports.some((report) => ran(report, "tone_map")), "tone mapping runs");
    assert.equal(await runs(visitor, "ray_cast"), "false", "the panel says so");
    assert.ok((await visitor.at("plan-ray_cast").locator(".plan-reason").innerText()).length > 5, "it says why");

    await visitor.page.mouse.move(5, 5);
    const { frames } = visitor;
    await pause(QUIET_MILLIS);
    assert.equal(visitor.frames, frames, "no picture comes while nothing changes");
    assert.equal(difference(brighter, await visitor.look()).most, 0);

    await visitor.at("statistics-close").click();
    await visitor.at("viewport").focus();
    await visitor.key("ArrowRight");
    await visitor.picture();
    await visitor.key("i");
    assert.equal(await runs(visitor, "ray_cast"), "true", "a turned view casts rays");
    assert.deepEqual(visitor.complaints, []);
  });
}
