import assert from "node:assert/strict";
import { difference } from "../lib/pixels.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theBall } from "../lib/world.js";

export function lightGridSteps() {
  step("light grid: convection-diffusion is chosen, shows other light, and its settings change it", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theBall()) });
    const local = await visitor.picture();
    assert.equal(await visitor.at("light-grid").count(), 0, "no settings of a light grid without one");

    await visitor.at("method-select").click();
    await visitor.at("method-convection_diffusion").click();
    const diffused = await visitor.picture();
    assert.equal(await visitor.data("method-select", "method"), "convection_diffusion");
    assert.ok(difference(local, diffused).mean > 0.5, "light with shadows is another picture");

    await visitor.at("diffusion").selectOption("none");
    const single = await visitor.picture();
    assert.ok(difference(diffused, single).mean > 0.5, "without diffusion it is darker");

    await visitor.at("diffusion").selectOption("heat");
    await visitor.picture();
    assert.equal(await visitor.at("heat-spread").count() > 0, true, "the heat flow has a spread");
    await visitor.at("scattering").selectOption("single");
    await until("the note", 5000, async () => (await visitor.at("diffusion-note").count()) === 1);

    await visitor.key("z");
    await visitor.key("z");
    await visitor.key("z");
    assert.ok(difference(diffused, await visitor.picture()).mean < 0.1, "undo brings the light back");
    assert.deepEqual(visitor.complaints, []);
  });
}
