import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { isMagenta } from "../lib/colours.js";
import { SHORT_MILLIS } from "../lib/page.js";
import { difference, pictureFromPng, region } from "../lib/pixels.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theLetter, world } from "../lib/world.js";

export function watchingSteps() {
  step("watching: a second page sees edits, turns its view, cannot edit, and takes a copy", async (arrive) => {
    const host = await arrive({ hash: await sessionOf(await theLetter()) });
    await host.picture();
    await host.context.grantPermissions(["clipboard-read", "clipboard-write"]);
    await host.at("share").click();
    await host.at("share-watch").click();
    await host.page.getByText("Link copied").waitFor();
    const link = await host.page.evaluate(() => navigator.clipboard.readText());
    const hash = link.slice(link.indexOf("#"));
    assert.ok(!link.includes(host.session()), "the link does not tell the session's own identifier");

    const guest = await arrive({ hash });
    const first = await guest.picture();
    assert.match(await guest.at("watch-bar").innerText(), /You are watching/);
    assert.ok(region(first, isMagenta).share > 0.01);
    assert.equal(await guest.at("undo").count(), 0);
    assert.equal(await guest.at("method-select").isDisabled(), true);

    // An edit of the host arrives; a turn of the guest is the guest's own.
    await host.dragToZero("tf-band-4");
    await host.picture();
    await until("the edit arrives", SHORT_MILLIS, async () => Number(await guest.data("tf-point-4", "opacity")) === 0);
    await guest.key("ArrowRight");
    assert.equal(region(await guest.picture(), isMagenta).share, 0);
    assert.equal(difference(await host.look(), await host.picture()).most, 0, "the host's view stays");

    // Neither pointer nor keys edit.
    const scene = async () => (await world.server.json("GET", `sessions/${host.session()}`)).epoch;
    const epoch = await scene();
    await guest.dragToZero("tf-band-2");
    for (const key of ["z", "w", "c"]) await guest.key(key);
    await guest.flushed();
    await host.key("ArrowLeft");
    await host.picture();
    assert.equal(await scene(), epoch);
    assert.equal(await guest.at("field-error").count(), 0);

    // A still is what is on screen.
    const shown = await guest.picture();
    const [download] = await Promise.all([guest.page.waitForEvent("download"), guest.at("save-still").click()]);
    assert.equal(difference(shown, pictureFromPng(await readFile(await download.path()))).most, 0);

    await guest.opening(() => guest.at("watch-copy").click());
    const copy = await guest.picture();
    assert.equal(await guest.at("watch-bar").count(), 0);
    assert.equal(region(copy, isMagenta).share, 0, "the copy is what was on screen");
    await guest.at("rig-flat").click();
    assert.ok(difference(copy, await guest.picture()).mean > 1, "and can be edited");
    await host.key("z");
    assert.ok(region(await host.picture(), isMagenta).share > 0.01, "the host's session is as it was");
    assert.deepEqual([...host.complaints, ...guest.complaints], []);
  });
}
