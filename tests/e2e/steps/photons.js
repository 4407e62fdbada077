import assert from "node:assert/strict";
import { difference, hashOf, pictureFromPng } from "../lib/pixels.js";
import { FINAL_MILLIS } from "../lib/page.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theLetter, world } from "../lib/world.js";

/** Few enough for a software device. */
/** Few, but enough to know what they are worth. */
const PATHS = 8;
const PHOTONS = { method: "photon_map", photons: 8192, photon_grid: 24 };

export function photonSteps() {
  step("photon map: frames follow a dragged curve, and the last one is that of a map made from scratch", async (arrive, context) => {
    const hash = await sessionOf(await theLetter());
    const visitor = await arrive({ hash });
    const local = await visitor.picture();
    assert.equal(await visitor.at("photons").count(), 0, "no settings of photons without them");
    await visitor.at("method-select").click();
    await visitor.at("method-photon_map").click();
    await visitor.picture();
    await world.server.json("PATCH", `sessions/${visitor.session()}/scene`, { illumination: PHOTONS });
    const lit = await visitor.picture();
    assert.ok((await visitor.at("photons").count()) > 0, "photons have settings");
    assert.ok(difference(local, lit).mean > 0.5, "light with shadows is another picture");

    // The strip under the curve now counts photons: all of them pass the empty values, few meet the knob.
    await until("shares of the photons", FINAL_MILLIS, async () => (await visitor.data("tf-edit-cost", "of")) === "photons");
    const hit = visitor.at("tf-edit-cost-hit");
    const [low, high] = [Number(await visitor.at("window-low").inputValue()), Number(await visitor.at("window-high").inputValue())];
    const shareAt = async (value) => {
      const { width } = await hit.boundingBox();
      await hit.hover({ position: { x: Math.min(width - 1, ((value - low) / (high - low)) * width), y: 3 } });
      return Number(await hit.getAttribute("data-share"));
    };
    const [empty, body, knob] = [await shareAt(5), await shareAt(100), await shareAt(250)];
    context.diagnostic(`share of photons that relied on empty space ${empty}, the letter ${body}, its knob ${knob}`);
    assert.ok(knob > 0 && knob < body && body < 1, `shares: ${empty}, ${body}, ${knob}`);
    assert.match(await visitor.page.getByText(/an edit at this value recomputes .* of the photons/).innerText(), /^\d+: an edit/);

    const before = visitor.headers.size;
    await visitor.dragToZero("tf-band-4");
    const without = await visitor.picture();
    assert.ok(visitor.headers.size > before + 1, "pictures came while it was dragged");
    assert.ok(difference(lit, without).mean > 0.2, "the knob and its shadow are gone");

    // What became of the edit is told: its times, and photons that were followed anew and that were not.
    await visitor.key("i");
    const rows = await visitor.at("edit-work").innerText();
    assert.match(rows, /first picture\s+[\d.]+ m?s/);
    assert.match(rows, /all of the light\s+[\d.]+ m?s/);
    assert.match(rows, /final picture\s+[\d.]+ m?s/);
    assert.match(rows, /photons\s+[\d.]+( k)? redone, [\d.]+( k)? reused/);
    assert.match(rows, /bricks\s+[\d.]+( k)? redone/);
    assert.match(await visitor.at("status-edit").innerText(), /[\d.]+ m?s \/ [\d.]+ m?s/);
    assert.equal(await visitor.at("status-light").count(), 0, "all of the light is there");

    // A still is drawn in a view of its own, in light of its own.
    const address = `${world.server.origin}/api/v1/sessions/${visitor.session()}/snapshot`;
    const answer = await fetch(`${address}?width=${without.width}&height=${without.height}`);
    assert.equal(answer.status, 200);
    assert.equal(hashOf(pictureFromPng(await answer.arrayBuffer())), hashOf(without));
    assert.deepEqual(visitor.complaints, []);
  });
  step("photon map: at rest paths refine the picture, and its error is told", async (arrive, context) => {
    const hash = await sessionOf(await theLetter());
    const visitor = await arrive({ hash });
    await world.server.json("PATCH", `sessions/${visitor.session()}/scene`, { illumination: { ...PHOTONS, paths_per_pixel: PATHS } });
    const lit = await visitor.picture();
    assert.equal(await visitor.at("paths-per-pixel").count(), 0, "paths have no settings where none are followed");
    assert.equal(await visitor.at("status-error").count(), 0, "photons do not know their error");
    await visitor.at("refine").click();
    const refined = await visitor.picture();
    const { mean } = difference(lit, refined);
    const error = await visitor.at("status-error").innerText();
    context.diagnostic(`refined by ${PATHS} paths: differs by ${mean}, told ${error}`);
    assert.ok(mean > 0.05 && mean < 5, `refined by ${mean}`);
    assert.ok(Number(/([\d.]+) %/.exec(error)?.[1]) < 30, error);
    assert.ok((await visitor.at("max-error").count()) > 0, "it can end at an error");

    // A key changes a count by one at least, where its slider is not linear, too.
    const paths = async () => Number(await visitor.at("paths-per-pixel").inputValue());
    await visitor.at("paths-per-pixel-slider").getByRole("slider").focus();
    await visitor.key("ArrowRight");
    assert.equal(await paths(), PATHS + 1);
    for (let key = 0; key < 3; key += 1) await visitor.key("ArrowLeft");
    assert.equal(await paths(), PATHS - 2);
    assert.deepEqual(visitor.complaints, []);
  });
}
