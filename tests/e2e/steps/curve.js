import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { isMagenta, isTeal } from "../lib/colours.js";
import { difference, isLit, region } from "../lib/pixels.js";
import { sessionOf, step, theLetter } from "../lib/world.js";

/** Points of the value 250, which the knob of the letter has. */
const KNOB = [4, 5];

const opacities = (visitor) => visitor.page.locator("circle[data-testid^=tf-point-]").evaluateAll((points) => points.map(({ dataset }) => Number(dataset.opacity)));
const selected = (visitor) => visitor.page.locator("circle[data-testid^=tf-point-][data-selected=true]").evaluateAll((points) => points.map(({ dataset }) => Number(dataset.testid.slice("tf-point-".length))));

export function curveSteps() {
  step("curve: a rectangle selects points, keys move them together, copies come back", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    const start = await visitor.picture();
    const before = await opacities(visitor);

    // A rectangle over the upper half takes the opaque points. Ctrl begins it over the curve, too.
    await visitor.page.keyboard.down("Control");
    await visitor.drag("tf-editor", [0.02, 0.02], [0.98, 0.4]);
    await visitor.page.keyboard.up("Control");
    const opaque = before.flatMap((opacity, index) => (opacity > 0.9 ? [index] : []));
    assert.deepEqual(await selected(visitor), opaque);
    assert.match(await visitor.at("tf-several").innerText(), new RegExp(`^${opaque.length} points$`));

    // The space bar takes single ones away, until those of the knob are left.
    for (const index of opaque.filter((other) => !KNOB.includes(other))) {
      await visitor.at(`tf-point-${index}`).focus();
      await visitor.key("Space");
    }
    assert.deepEqual(await selected(visitor), KNOB);
    await visitor.at(`tf-point-${KNOB[0]}`).focus();
    await visitor.key("Control+c");

    await visitor.at("tf-extinction").fill("0");
    await visitor.at("tf-extinction").press("Enter");
    const without = await visitor.picture();
    assert.equal(region(without, isMagenta).share, 0, "both points of the knob are at 0");
    assert.ok(region(without, isTeal).share > 0.05);

    await visitor.at(`tf-point-${KNOB[0]}`).focus();
    await visitor.at("viewport").hover();
    await visitor.key("Control+v");
    const pasted = await visitor.picture();
    assert.deepEqual(await opacities(visitor), before, "the copies stand where they were");
    assert.ok(difference(start, pasted).mean < 0.05, "and the knob is back");

    // Of three things done, two changed the scene.
    await visitor.key("z");
    await visitor.picture();
    await visitor.key("z");
    await visitor.picture();
    assert.deepEqual(await opacities(visitor), before);
    assert.equal(await visitor.data("undo", "disabled"), "true");
    assert.deepEqual(visitor.complaints, []);
  });

  step("curve: saved and opened again, painted by a colour map, and zoomed", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    const start = await visitor.picture();
    const before = await opacities(visitor);
    await visitor.at("tf-menu").click();
    const [download] = await Promise.all([visitor.page.waitForEvent("download"), visitor.at("tf-save").click()]);
    assert.equal(download.suggestedFilename(), "letter.tf.json");
    const saved = await readFile(await download.path());
    assert.ok(JSON.parse(saved).transfer_function.points.length === before.length);

    await visitor.at("tf-colours").click();
    await visitor.at("tf-map-Greys").click();
    const grey = await visitor.picture();
    assert.equal(region(grey, isMagenta).share + region(grey, isTeal).share, 0, "no colour is left");
    assert.ok(Math.abs(region(grey, isLit).share / region(start, isLit).share - 1) < 0.5, "what is seen stays");

    await visitor.at("tf-file").setInputFiles({ name: "letter.tf.json", mimeType: "application/json", buffer: saved });
    assert.ok(difference(start, await visitor.picture()).mean < 0.05, "the file brings it back");

    await visitor.at("tf-file").setInputFiles({ name: "nonsense.json", mimeType: "application/json", buffer: Buffer.from("{}") });
    await visitor.page.getByText("This is not a transfer function").waitFor();

    // Where the curve is low, a zoomed window has an axis of its own.
    await visitor.at("tf-editor").focus();
    for (const key of ["Delete", "Control+a"]) await visitor.key(key);
    assert.deepEqual(await selected(visitor), before.map((_, index) => index), "without a selection nothing is removed");
    // An opacity of 0.012.
    await visitor.at("tf-extinction").fill("1.2");
    await visitor.at("tf-extinction").press("Enter");
    assert.equal(await visitor.data("tf-editor", "ceiling"), "1");
    await visitor.at("tf-editor").focus();
    await visitor.key("+");
    assert.equal(await visitor.data("tf-editor", "ceiling"), "0.02");
    await visitor.key("0");
    assert.equal(await visitor.data("tf-editor", "window"), "0 1");
    assert.deepEqual(visitor.complaints, []);
  });
}
