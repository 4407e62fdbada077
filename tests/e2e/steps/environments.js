import assert from "node:assert/strict";
import { FINAL_MILLIS, SHORT_MILLIS } from "../lib/page.js";
import { difference, hashOf, meanLuma } from "../lib/pixels.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theBall, world } from "../lib/world.js";

/** Paths a pixel of finished pictures: few, software devices are slow. */
const PATHS = 1;
/** Texels of `sky` around the horizon and from pole to pole. */
const SKY = [16, 8];
/** Records that exchange light: few, for software devices. */
const RECORDS = { method: "image_based", records: 12, record_directions: 12 };

/** A Radiance picture (uncompressed RGBE) that shines from the left half of its columns. */
function sky() {
  const [width, height] = SKY;
  const head = Buffer.from(`#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y ${height} +X ${width}\n`, "latin1");
  const texels = Array.from({ length: width * height }, (_, at) => (at % width < width / 2 ? [128, 128, 128, 130] : [128, 128, 128, 122])).flat();
  return Buffer.concat([head, Buffer.from(texels)]);
}

/** A scene lit by its environment alone. */
async function visit(arrive) {
  const hash = await sessionOf(await theBall());
  await world.server.json("PATCH", `sessions/${hash.slice("#session=".length)}/scene`, {
    illumination: { paths_per_pixel: PATHS }, scattering: { orders: 1 }, lights: [{ type: "environment", id: "room", radiance: [0.5, 0.5, 0.5] }],
  });
  const visitor = await arrive({ hash });
  await visitor.picture();
  await visitor.at("light-select-0").click();
  await visitor.at("environment-studio").waitFor();
  return visitor;
}

/** Luma of the right half over that of the left half. */
const rightOverLeft = (picture) => meanLuma(picture, (x) => x >= picture.width / 2) / meanLuma(picture, (x) => x < picture.width / 2);

export function environmentSteps() {
  step("environments: a picture of light is chosen, turned, seen, and left again", async (arrive) => {
    const visitor = await visit(arrive);
    const uniform = await visitor.picture();
    assert.equal(await visitor.data("method-select", "method"), "local");
    await visitor.at("environment-studio").click();
    assert.match(await visitor.at("environment-note").innerText(), /Path traced/);
    const studio = await visitor.picture();
    assert.equal(await visitor.data("method-select", "method"), "path_traced");
    assert.equal(await visitor.at("environment-studio").getAttribute("aria-pressed"), "true");
    assert.ok(difference(uniform, studio).mean > 1, "the picture changes");

    // The large soft box from the left comes from the right after half a turn; one drag is one step.
    const before = rightOverLeft(studio);
    await visitor.drag("environment-strip", [0.25, 0.5], [0.75, 0.5]);
    const turned = await visitor.picture();
    assert.equal(Math.abs(Number(await visitor.at("environment-strip").getAttribute("aria-valuenow"))), 180);
    assert.ok(before < 0.95 && rightOverLeft(turned) > 1.05, `right over left: ${before}, ${rightOverLeft(turned)}`);
    await visitor.at("environment-strip").press("ArrowRight");
    await until("it comes round", SHORT_MILLIS, async () => Number(await visitor.at("environment-strip").getAttribute("aria-valuenow")) === -178);
    await visitor.key("z");
    await visitor.key("z");
    assert.ok(Math.abs(rightOverLeft(await visitor.picture()) - before) < 0.03, "both turns are taken back");

    const corner = (picture) => meanLuma(picture, (x, y) => x < 20 && y < 20);
    const dark = corner(studio);
    await visitor.at("environment-behind").click();
    assert.ok(corner(await visitor.picture()) > dark + 4, "the room is seen behind the volume");
    await visitor.key("z");

    // `local` takes no pictures: the light becomes uniform, says so, and comes back with one undo.
    await visitor.at("method-select").click();
    await visitor.at("method-local").click();
    assert.match(await visitor.at("method-side-effect").innerText(), /uniform/);
    await visitor.picture();
    assert.equal(await visitor.at("environment-uniform").getAttribute("aria-pressed"), "true");
    await visitor.key("z");
    await visitor.picture();
    assert.equal(await visitor.at("environment-studio").getAttribute("aria-pressed"), "true");
    assert.equal(await visitor.at("method-side-effect").count(), 0);
    await visitor.key("z");
    assert.ok(difference(uniform, await visitor.picture()).mean < 0.05, "where it began");
    assert.equal(await visitor.data("method-select", "method"), "local");
    assert.deepEqual(visitor.complaints, []);
  });

  step("environments: image-based lighting follows the light as it is turned, with settings of its own", async (arrive) => {
    const visitor = await visit(arrive);
    await visitor.at("method-select").click();
    await visitor.at("method-image_based").click();
    const uniform = await visitor.picture();
    assert.equal(await visitor.data("method-select", "method"), "image_based");
    await visitor.at("environment-studio").click();
    const studio = await visitor.picture();
    assert.equal(await visitor.data("method-select", "method"), "image_based", "it takes pictures of light");
    assert.ok(difference(uniform, studio).mean > 1, "the picture changes");
    const before = rightOverLeft(studio);
    await visitor.drag("environment-strip", [0.25, 0.5], [0.75, 0.5]);
    const turned = await visitor.picture();
    assert.ok(before < 0.97 && rightOverLeft(turned) > 1.03, `right over left: ${before}, ${rightOverLeft(turned)}`);

    // One record for each cell, and few of them: steps are seen. Undo brings the smooth picture back.
    await visitor.at("record-lookup").selectOption("containing");
    const steps = await visitor.picture();
    assert.ok(difference(turned, steps).mean > 0.05, "cells are seen");
    await visitor.key("z");
    assert.ok(difference(turned, await visitor.picture()).mean < 0.05, "the smooth picture is back");
    assert.deepEqual(visitor.complaints, []);
  });

  step("environments: records exchange light, each round makes matter brighter, and one drag is one undo step", async (arrive, context) => {
    const hash = await sessionOf(await theBall());
    const scene = `sessions/${hash.slice("#session=".length)}/scene`;
    await world.server.json("PATCH", scene, { sampling: { samples_per_pixel: 1 }, lights: [{ type: "environment", id: "room", radiance: [0.5, 0.5, 0.5] }], illumination: RECORDS });
    const visitor = await arrive({ hash });
    const rounds = async () => (await world.server.json("GET", scene)).illumination.record_exchange;
    const once = await visitor.picture();
    assert.deepEqual([await rounds(), await visitor.at("record-exchange").inputValue()], [0, "0"]);

    await visitor.at("record-exchange").fill("1");
    const twice = await visitor.picture();
    assert.equal(await rounds(), 1);

    await visitor.drag("record-exchange-slider", [1 / 64, 0.5], [8 / 64, 0.5]);
    const often = await visitor.picture();
    const dragged = await rounds();
    assert.ok(dragged > 5 && dragged < 11, `an eighth of 64: ${dragged}`);
    assert.equal(await visitor.at("record-exchange").inputValue(), String(dragged));
    const [dark, brighter, brightest] = [once, twice, often].map((picture) => meanLuma(picture));
    context.diagnostic(`luma without exchange ${dark}, 1 round ${brighter}, ${dragged} rounds ${brightest}`);
    assert.ok(brighter > dark + 1 && brightest > brighter + 1, `luma: ${dark}, ${brighter}, ${brightest}`);

    await visitor.at("viewport").focus();
    await visitor.key("z");
    assert.equal(hashOf(await visitor.picture()), hashOf(twice));
    assert.equal(await rounds(), 1);
    assert.deepEqual(visitor.complaints, []);
  });

  step("environments: a file is opened, refused in words, and removed", async (arrive) => {
    const visitor = await visit(arrive);
    await visitor.at("environment-file").setInputFiles({ name: "broken.hdr", mimeType: "", buffer: Buffer.from("not light") });
    await visitor.at("environment-problem").waitFor();
    assert.match(await visitor.at("environment-problem").innerText(), /broken\.hdr: \S+/);

    await visitor.at("environment-file").setInputFiles({ name: "half.hdr", mimeType: "", buffer: sky() });
    const tile = visitor.page.locator(".environment-tile", { hasText: "half.hdr" });
    await until("it is chosen", SHORT_MILLIS, async () => (await tile.count()) === 1 && (await tile.getAttribute("aria-pressed")) === "true");
    assert.equal(await visitor.at("environment-problem").count(), 0);
    // Its bright half, columns 0 to 1/2, lies to the right of the viewer in front.
    const lit = await visitor.picture();
    assert.ok(rightOverLeft(lit) > 1.1, `right over left: ${rightOverLeft(lit)}`);

    await visitor.at("environment-uniform").click();
    await visitor.page.getByRole("button", { name: "Delete half.hdr" }).click();
    await visitor.at("environment-delete-confirm").click();
    await until("it is gone", FINAL_MILLIS, async () => (await tile.count()) === 0);
    assert.equal(visitor.complaints.filter((words) => !words.includes("422")).length, 0, visitor.complaints.join("\n"));
  });
}
