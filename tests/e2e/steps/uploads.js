import assert from "node:assert/strict";
import { mkdtemp, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { artifact } from "../lib/artifacts.js";
import { cut, difference, isLit, region } from "../lib/pixels.js";
import { largeNrrd, letterL, realScan, truncatedNrrd } from "../lib/volumes.js";
import { pause, until } from "../lib/wait.js";
import { sessionOf, step, theLetter, world } from "../lib/world.js";
import { isTeal, isMagenta } from "../lib/colours.js";

const UPLOAD_MILLIS = 20_000;

/** A link on which the large file takes half a minute, bytes per second. */
const SLOW_LINK = 300_000;

/** A link whose upload speed can be set, bytes per second; -1 is no limit. Holds across reloads. */
async function linkOf(visitor) {
  const link = await visitor.context.newCDPSession(visitor.page);
  await link.send("Network.enable");
  return (uploadThroughput) => link.send("Network.emulateNetworkConditions", { offline: false, latency: 0, downloadThroughput: -1, uploadThroughput });
}

const file = (name, buffer) => ({ name, mimeType: "application/octet-stream", buffer });

/** The tile of an upload, once it is in this state. */
async function tileOf(visitor, name, state) {
  const tile = visitor.page.locator(`[data-testid=upload][data-name="${name}"]`);
  await until(`the upload of ${name} is ${state}`, UPLOAD_MILLIS, async () => (await tile.getAttribute("data-state")) === state);
  return tile;
}

export function uploadSteps() {
  step("upload: a NIfTI file is recognised, and lies the right way round", async (arrive) => {
    const visitor = await arrive();
    await visitor.at("upload-input").setInputFiles(file("letter.nii", letterL()));
    const tile = await tileOf(visitor, "letter.nii", "done");
    const facts = await tile.getByTestId("dataset-facts").innerText();
    for (const fact of ["nifti", "40 × 40 × 40 voxels", "1 × 1 × 1 mm", "uint8", "0 to 250", "anatomical (LPS)"]) {
      assert.ok(facts.includes(fact), `recognised: ${fact} in ${facts}`);
    }
    await visitor.opening(() => tile.getByTestId("upload-explore").click());
    const picture = await visitor.picture();
    assert.equal(await visitor.at("dataset-select").locator("option:checked").innerText(), "letter");

    // Seen from the front, the patient's left is on the right: there stands the tower.
    const whole = region(picture, isTeal);
    assert.ok(whole.share > 0.1, `share of the letter: ${whole.share}`);
    const top = region(cut(picture, [0, 0], [1, 0.45]), isTeal);
    const bottom = region(cut(picture, [0, 0.55], [1, 1]), isTeal);
    assert.ok(top.share > 0.03 && top.x > 0.62, `tower: ${JSON.stringify(top)}`);
    assert.ok(bottom.share > 2 * top.share && Math.abs(bottom.x - 0.5) < 0.1, `foot: ${JSON.stringify(bottom)}`);
    const knob = region(picture, isMagenta);
    assert.ok(knob.share > 0.01 && knob.y > 0.55 && Math.abs(knob.x - 0.5) < 0.1, `knob: ${JSON.stringify(knob)}`);
    assert.deepEqual(visitor.complaints, []);
  });

  step("upload: a truncated file is refused in words, and nothing else breaks", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    const before = await visitor.picture();
    await visitor.at("upload-input").setInputFiles(file("broken.nrrd", truncatedNrrd()));
    const tile = await tileOf(visitor, "broken.nrrd", "failed");
    const words = await tile.getByTestId("upload-error").innerText();
    assert.match(words, /4096|1000|short|truncated|ends|missing/i, `says what is wrong: ${words}`);
    assert.doesNotMatch(words, /panic|unwrap|Error\(|\{"/, `in words: ${words}`);
    assert.equal(await visitor.page.locator("[data-testid=datasets-mine] li", { hasText: "broken" }).count(), 0);

    const after = await visitor.look();
    assert.equal(after.state, "final");
    assert.equal(difference(before, after).most, 0, "the picture stays");
    await visitor.at("upload-input").setInputFiles(file("abdomen.nrrd", await realScan()));
    await tileOf(visitor, "abdomen.nrrd", "done");
    await visitor.key("ArrowRight");
    assert.ok(difference(before, await visitor.picture()).mean > 0.3, "the view still turns");
    assert.ok(region(after, isLit).share > 0.1);
    assert.deepEqual(visitor.complaints, []);
  });

  step("upload: it can be paused, survives a reload and a restart of the service, and goes on by itself", async (arrive) => {
    const folder = await mkdtemp(join(tmpdir(), "tyndall-upload-"));
    try {
      // A file on disk: its name, size and date are the same when it is chosen again.
      const path = join(folder, "slow.nrrd");
      await writeFile(path, largeNrrd());
      const visitor = await arrive({ height: 900 });
      const patches = [];
      visitor.page.on("request", (request) => {
        if (request.method() === "PATCH" && request.url().includes("/uploads/")) patches.push(Number(request.headers()["upload-offset"]));
      });
      const percent = async (tile) => Number.parseInt(await tile.getByTestId("upload-progress").innerText(), 10);
      const beyond = (tile, share) => until(`${share} % are sent`, UPLOAD_MILLIS, async () => (await percent(tile)) > share);
      const limit = await linkOf(visitor);
      await limit(SLOW_LINK);
      await visitor.at("upload-input").setInputFiles(path);
      const tile = await tileOf(visitor, "slow.nrrd", "sending");
      await beyond(tile, 3);
      await visitor.page.screenshot({ path: artifact("upload-sending.png") });

      await tile.getByTestId("upload-pause").click();
      await tileOf(visitor, "slow.nrrd", "paused");
      await visitor.page.screenshot({ path: artifact("upload-paused.png") });
      const paused = await percent(tile);
      await pause(1000);
      assert.equal(await percent(tile), paused, "nothing goes while it is paused");
      await tile.getByTestId("upload-resume").click();
      await beyond(tile, paused + 3);
      assert.ok(patches.length >= 2 && patches.at(-1) > 0, `it goes on from where it was: ${patches}`);

      await visitor.page.reload();
      const left = await tileOf(visitor, "slow.nrrd", "left");
      assert.ok((await percent(left)) >= paused, "what was sent is kept");
      assert.match(await left.getByTestId("upload-left").innerText(), /same file again/);
      await visitor.page.screenshot({ path: artifact("upload-left.png") });
      const kept = await percent(left);
      await left.getByTestId("upload-again-input").setInputFiles(path);
      await tileOf(visitor, "slow.nrrd", "sending");
      assert.equal(await visitor.page.locator("[data-testid=upload]").count(), 1, "one tile for one upload");
      await beyond(left, kept);

      await world.server.kill();
      await until("the page notices", UPLOAD_MILLIS, async () => (await visitor.at("upload-waiting").count()) === 1);
      await visitor.page.screenshot({ path: artifact("upload-waiting.png") });
      await world.server.start();
      await limit(-1);
      const done = await tileOf(visitor, "slow.nrrd", "done");
      assert.match(await done.getByTestId("dataset-facts").innerText(), /128 × 128 × 256/);
      assert.ok(patches.slice(1).every((offset) => offset > 0), `nothing was sent twice: ${patches}`);
      await visitor.page.screenshot({ path: artifact("upload-done.png") });
      await visitor.page.reload();
      await visitor.at("datasets-mine").waitFor();
      assert.equal(await visitor.page.locator("[data-testid=upload]").count(), 0, "a finished upload leaves no tile");
    } finally {
      await rm(folder, { recursive: true, force: true });
    }
  });

  step("upload: a cancelled one leaves nothing at the service", async (arrive) => {
    const visitor = await arrive();
    await (await linkOf(visitor))(SLOW_LINK);
    const begun = visitor.page.waitForResponse((answer) => answer.request().method() === "POST" && answer.url().endsWith("/uploads"));
    await visitor.at("upload-input").setInputFiles(file("unwanted.nrrd", largeNrrd()));
    const { location } = (await begun).headers();
    const tile = await tileOf(visitor, "unwanted.nrrd", "sending");
    await tile.getByTestId("upload-cancel").click();
    await until("the tile is gone", UPLOAD_MILLIS, async () => (await tile.count()) === 0);
    assert.equal((await fetch(new URL(location, world.server.origin))).status, 404);
    await visitor.page.reload();
    await visitor.at("datasets-samples").waitFor();
    assert.equal(await visitor.page.locator("[data-testid=upload]").count(), 0);
  });
}
