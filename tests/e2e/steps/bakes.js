import assert from "node:assert/strict";
import { difference, hashOf } from "../lib/pixels.js";
import { FINAL_MILLIS } from "../lib/page.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theBall, world } from "../lib/world.js";

/** Small enough for a software device, long enough to be seen at work. */
const BAKE = { method: "precomputed_transfer", transfer_lights: 42, transfer_grid: 16, transfer_directions: 48, transfer_photons: 131072 };
const SKY = [{ id: "sky", type: "environment", radiance: [1, 1, 1] }];
const SUN = { id: "sun", type: "directional", direction: [-1, -1, -0.5], irradiance: [3, 2, 1] };

export function bakeSteps() {
  step("precomputed light: it is baked with progress, lights are free, an edit says that light is old", async (arrive, context) => {
    const visitor = await arrive({ hash: await sessionOf(await theBall()) });
    await visitor.picture();
    assert.equal(await visitor.at("transfer-lights").count(), 0, "no settings of a bake without one");
    let epoch = 0;
    const patch = async (body) => {
      ({ epoch } = await world.server.json("PATCH", `sessions/${visitor.session()}/scene`, body));
    };
    const picture = async () => {
      await until("a picture of the edit", FINAL_MILLIS, async () => Number(await visitor.data("viewport", "epoch")) >= epoch);
      return visitor.picture();
    };
    await patch({ lights: SKY, illumination: BAKE });
    const mark = visitor.at("bake-mark");
    await until("the bake at work", FINAL_MILLIS, async () => (await mark.count()) === 1);
    const words = await mark.innerText();
    assert.match(words, /Baking light\s+\d+ %/);
    context.diagnostic(words.replace(/\s+/g, " "));
    await until("a time", FINAL_MILLIS, async () => (await mark.count()) === 0 || / left/.test(await mark.innerText()));
    const sky = await picture();
    assert.equal(await mark.count(), 0, "it is done");
    assert.equal(await visitor.at("transfer-lights").inputValue(), "42");
    assert.equal(await visitor.at("transfer-directions").inputValue(), "48");

    // Another light costs no bake.
    await patch({ lights: [...SKY, SUN] });
    const sunny = await picture();
    assert.ok(difference(sky, sunny).mean > 0.5, "the sun is seen");
    await visitor.key("i");
    const counters = await visitor.at("counters").innerText();
    assert.match(counters, /transfer photons traced\s+0\s/);
    assert.match(counters, /transfer rays marched\s+0\s/);
    await visitor.key("i");

    // Other matter: the light before stays, and says so.
    await patch({ density: 3 });
    await until("old light, marked", FINAL_MILLIS, async () => (await mark.count()) === 1 && (await mark.getAttribute("data-old")) === "true");
    assert.match(await mark.innerText(), /before the edit/);
    const dense = await picture();
    assert.equal(await mark.count(), 0);
    assert.ok(difference(sunny, dense).mean > 0.2, "denser matter is another picture");

    // What was baked before is not baked again.
    await patch({ density: 1 });
    assert.equal(hashOf(await picture()), hashOf(sunny));
    assert.deepEqual(visitor.complaints, []);
  });
}
