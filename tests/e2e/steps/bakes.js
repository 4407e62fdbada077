import assert from "node:assert/strict";
import { marksOf, watchMarks } from "../lib/marks.js";
import { FINAL_MILLIS } from "../lib/page.js";
import { difference, hashOf } from "../lib/pixels.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theBall, world } from "../lib/world.js";

/** Small enough for a software device, long enough to be seen at work there. */
const BAKE = { method: "precomputed_transfer", transfer_lights: 42, transfer_grid: 12, transfer_directions: 48, transfer_photons: 32768, transfer_events: 4, transfer_bands: 1 };
const SKY = [{ id: "sky", type: "environment", radiance: [1, 1, 1] }];
/** Many photons: a software device is long at work on them. */
const PHOTONS = { method: "photon_map", photons: 1 << 18, photon_grid: 24 };
/** So large that its compression can be seen. */
const LARGE = { transfer_lights: 162, transfer_grid: 32, transfer_photons: 4096, transfer_bands: 3, transfer_clusters: 256 };
const SUN = { id: "sun", type: "directional", direction: [-1, -1, -0.5], irradiance: [3, 2, 1] };

export function bakeSteps() {
  step("precomputed light: it is baked with progress, lights are free, an edit says that light is old", async (arrive, context) => {
    const visitor = await arrive({ hash: await sessionOf(await theBall()) });
    await visitor.picture();
    assert.equal(await visitor.at("transfer-lights").count(), 0, "no settings of a bake without one");
    // Elsewhere a bake may be over before a picture tells of it.
    const { device: { software } } = await world.server.json("GET", "status");
    const marks = () => marksOf(visitor.page);
    await watchMarks(visitor.page);
    let epoch = 0;
    const patch = async (body) => {
      ({ epoch } = await world.server.json("PATCH", `sessions/${visitor.session()}/scene`, body));
    };
    const picture = async () => {
      await until("a picture of the edit", FINAL_MILLIS, async () => Number(await visitor.data("viewport", "epoch")) >= epoch);
      return visitor.picture();
    };

    await patch({ lights: SKY, illumination: BAKE });
    const sky = await picture();
    const first = await marks();
    context.diagnostic(first.map(({ words }) => words).join("; "));
    assert.ok(!software || first.some(({ old, words }) => !old && /^Baking light \d+ %/.test(words)), "progress");
    assert.equal(await visitor.at("light-mark").count(), 0, "it is done");
    assert.equal(await visitor.at("transfer-lights").inputValue(), "42");
    assert.equal(await visitor.at("transfer-directions").inputValue(), "48");

    // Another light costs no bake.
    const before = visitor.reports.length;
    await patch({ lights: [...SKY, SUN] });
    const sunny = await picture();
    assert.ok(difference(sky, sunny).mean > 0.5, "the sun is seen");
    assert.deepEqual((await marks()).filter(({ old }) => old), [], "it is not old light");
    const sum = (name) => visitor.reports.slice(before).reduce((all, { counters }) => all + (counters[name] ?? 0), 0);
    await until("the report of the light", FINAL_MILLIS, async () => sum("transfer_rows_lit") > 0);
    assert.deepEqual([sum("transfer_photons_traced"), sum("transfer_rays_marched")], [0, 0]);

    // Other matter: the light before stays, and says so.
    await patch({ density: 3 });
    const dense = await picture();
    const second = await marks();
    context.diagnostic(second.map(({ words }) => words).join("; "));
    assert.ok(!software || second.some(({ old, words }) => old && /before the edit; baking anew \d+ %/.test(words)), "old light, marked");
    assert.equal(await visitor.at("light-mark").count(), 0);
    assert.ok(difference(sunny, dense).mean > 0.2, "denser matter is another picture");

    // What was baked before is not baked again.
    await patch({ density: 1 });
    assert.equal(hashOf(await picture()), hashOf(sunny));
    assert.deepEqual(visitor.complaints, []);
  });

  step("light on its way: a mark tells of any method's, of its own pictures alone, and how a bake ends", async (arrive, context) => {
    const visitor = await arrive({ hash: await sessionOf(await theBall()) });
    await visitor.picture();
    const { device: { software } } = await world.server.json("GET", "status");
    const patch = (body) => world.server.json("PATCH", `sessions/${visitor.session()}/scene`, body);
    await watchMarks(visitor.page);

    await patch({ lights: [...SKY, SUN], illumination: PHOTONS });
    // Elsewhere photons may be there before the mark.
    if (software) await visitor.at("light-mark").waitFor({ timeout: FINAL_MILLIS });
    assert.equal(await visitor.at("status-light").count(), await visitor.at("light-mark").count());
    const { epoch } = await patch({ illumination: { ...BAKE, ...LARGE } });
    await visitor.at("compression-error").waitFor({ timeout: FINAL_MILLIS });
    await until("all of the light", FINAL_MILLIS, async () => (await visitor.at("light-mark").count()) === 0);
    const marks = await marksOf(visitor.page);
    context.diagnostic([...new Set(marks.map(({ words }) => words))].join("; "));
    const ofPhotons = marks.filter(({ epoch: shown }) => shown < epoch);
    const ofBake = marks.filter(({ epoch: shown }) => shown >= epoch);
    assert.ok(!software || ofPhotons.length > 0 && ofBake.length > 0, "both are told of");
    for (const { words } of ofPhotons) assert.match(words, /^Light \d+ %/, "no bake before its first picture");
    assert.ok(!software || ofBake.at(-1).words === "Compressing the bake", "its end");
    const compressing = ofBake.findIndex(({ words }) => words === "Compressing the bake");
    for (const { words } of ofBake.slice(0, Math.max(0, compressing))) assert.match(words, /^(Baking light|Light of before the edit; baking anew) \d+ %/);
    // Readers of screens hear what goes on, and no numbers.
    for (const { said } of marks) assert.match(said, /^[A-Za-z; ]+$/);
    assert.deepEqual(visitor.complaints, []);
  });

  step("precomputed light: a light with a place is switched off for it, and says so", async (arrive) => {
    const hash = await sessionOf(await theBall());
    const scene = `sessions/${hash.slice("#session=".length)}/scene`;
    const lamp = { id: "lamp", type: "point", position: [1, 1, 1], intensity: [1, 1, 1] };
    await world.server.json("PATCH", scene, { lights: [...SKY, lamp], illumination: { ...BAKE, method: "local" } });
    const visitor = await arrive({ hash });
    await visitor.picture();
    await visitor.at("method-select").click();
    await visitor.at("method-precomputed_transfer").click();
    assert.match(await visitor.at("method-side-effect").innerText(), /distant light only: one light is off now/);
    await visitor.picture();
    const { lights, illumination } = await world.server.json("GET", scene);
    assert.deepEqual([illumination.method, ...lights.map(({ enabled }) => enabled)], ["precomputed_transfer", true, false]);
    await visitor.key("z");
    await visitor.picture();
    assert.deepEqual([await visitor.data("method-select", "method"), await visitor.data("light-1", "enabled")], ["local", "true"]);
    assert.deepEqual(visitor.complaints, []);
  });

  step("precomputed light: a bake is compressed on request, what that leaves out is told, and undo brings the bake back", async (arrive, context) => {
    const hash = await sessionOf(await theBall());
    const scene = `sessions/${hash.slice("#session=".length)}/scene`;
    await world.server.json("PATCH", scene, { sampling: { samples_per_pixel: 1 }, lights: [...SKY, SUN], illumination: { ...BAKE, transfer_photons: 8192 } });
    const visitor = await arrive({ hash });
    const clusters = async () => (await world.server.json("GET", scene)).illumination.transfer_clusters;
    const errors = () => visitor.reports.map(({ counters }) => counters.transfer_compression_error_ppm).filter((ppm) => ppm !== undefined);
    const baked = async () => {
      const picture = await visitor.picture();
      return (await visitor.at("light-mark").count()) === 0 && picture;
    };
    const whole = await until("a finished bake", FINAL_MILLIS, baked);
    assert.equal(await clusters(), 0);
    assert.equal(await visitor.at("transfer-clusters").inputValue(), "0");
    assert.deepEqual([await visitor.at("compression-error").count(), errors()], [0, []], "nothing is left out");
    assert.match(await visitor.at("bake-cost").innerText(), /compression takes the bake as it is/);

    const before = visitor.reports.length;
    await visitor.at("transfer-clusters").selectOption("32");
    await visitor.at("compression-error").waitFor({ timeout: FINAL_MILLIS });
    assert.equal(await clusters(), 32);
    const work = visitor.reports.slice(before).map(({ counters }) => (counters.transfer_photons_traced ?? 0) + (counters.transfer_rays_marched ?? 0));
    assert.deepEqual(work.filter((count) => count > 0), [], "nothing is baked for it");
    assert.match(await visitor.at("bake-cost").innerText(), /bake all anew, another compression too/);
    const words = await visitor.at("compression-error").innerText();
    const percent = Number(/^Compression leaves out ([\d.]+) % of the bake/.exec(words)?.[1]);
    assert.ok(percent > 0.1 && percent < 50, words);
    assert.ok(Math.abs(errors().at(-1) / 1e4 - percent) <= 0.05 * percent, `${words} The service: ${errors().at(-1)} ppm`);
    const compressed = await until("a picture of what is kept", FINAL_MILLIS, async () => {
      const picture = await baked();
      return picture && hashOf(picture) !== hashOf(whole) && picture;
    });
    const { mean } = difference(whole, compressed);
    context.diagnostic(`${words} The picture differs by ${mean}`);
    assert.ok(mean < 3, `it is nearly the same picture: ${mean}`);

    await visitor.key("z");
    await until("the whole bake", FINAL_MILLIS, async () => {
      const picture = await baked();
      return picture && hashOf(picture) === hashOf(whole);
    });
    assert.equal(await clusters(), 0);
    assert.equal(await visitor.at("compression-error").count(), 0);
    assert.deepEqual(visitor.complaints, []);
  });
}
