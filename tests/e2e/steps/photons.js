import assert from "node:assert/strict";
import { difference, hashOf, pictureFromPng } from "../lib/pixels.js";
import { sessionOf, step, theLetter, world } from "../lib/world.js";

/** Few enough for a software device. */
const PHOTONS = { method: "photon_map", photons: 8192, photon_grid: 24 };

export function photonSteps() {
  step("photon map: frames follow a dragged curve, and the last one is that of a map made from scratch", async (arrive) => {
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

    const before = visitor.headers.size;
    await visitor.dragToZero("tf-band-4");
    const without = await visitor.picture();
    assert.ok(visitor.headers.size > before + 1, "pictures came while it was dragged");
    assert.ok(difference(lit, without).mean > 0.2, "the knob and its shadow are gone");

    // A still is drawn in a view of its own, in light of its own.
    const address = `${world.server.origin}/api/v1/sessions/${visitor.session()}/snapshot`;
    const answer = await fetch(`${address}?width=${without.width}&height=${without.height}`);
    assert.equal(answer.status, 200);
    assert.equal(hashOf(pictureFromPng(await answer.arrayBuffer())), hashOf(without));
    assert.deepEqual(visitor.complaints, []);
  });
}
