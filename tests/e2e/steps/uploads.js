import assert from "node:assert/strict";
import { cut, difference, isLit, region } from "../lib/pixels.js";
import { letterL, realScan, truncatedNrrd } from "../lib/volumes.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theLetter } from "../lib/world.js";
import { isTeal, isMagenta } from "../lib/colours.js";

const UPLOAD_MILLIS = 20_000;

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
    // The browser itself notes the refused request; nothing else may be noted.
    assert.deepEqual(visitor.complaints.filter((text) => !/status of 422/.test(text)), []);
  });
}
