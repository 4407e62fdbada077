import assert from "node:assert/strict";
import { difference } from "../lib/pixels.js";
import { FINAL_MILLIS, SHORT_MILLIS } from "../lib/page.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theBall, theLetter, world } from "../lib/world.js";

/** The identifier under which a session is listed: that for watching it. */
const listedAs = async (id) => (await world.server.json("GET", `sessions/${id}`)).watch;

export function gallerySteps() {
  step("gallery: a session is found, watched and copied; one's own are joined and ended", async (arrive) => {
    const hash = await sessionOf(await theLetter());
    const host = await arrive({ hash });
    await host.key("ArrowRight");
    const shown = await host.picture();
    const letter = await listedAs(host.session());

    const guest = await arrive({ hash: await sessionOf(await theBall()) });
    const ballId = guest.session();
    const ball = await listedAs(ballId);
    await guest.picture();
    await guest.key("g");
    const tile = guest.at(`session-${letter}`);
    await tile.waitFor();
    assert.match(await tile.innerText(), /letter[\s\S]*used just now[\s\S]*1 viewer/);
    await guest.context.grantPermissions(["clipboard-read", "clipboard-write"]);
    await tile.getByTestId("session-watch").click();
    await guest.page.getByText("Link copied").waitFor();
    const link = await guest.page.evaluate(() => navigator.clipboard.readText());
    assert.ok(link.startsWith(`${guest.origin}/#session=`) && link.includes(letter) && !link.includes(host.session()), link);
    assert.equal(await guest.data(`session-${ball}`, "mine"), "true");
    await until("its picture", FINAL_MILLIS, async () => (await tile.locator(".gallery-picture").getAttribute("data-drawn")) === "true");
    for (const forEditors of ["session-join", "session-end"]) assert.equal(await tile.getByTestId(forEditors).count(), 0);
    await guest.opening(() => tile.getByTestId("session-look").click());
    assert.equal(guest.session(), letter);
    await guest.at("watch-bar").waitFor();
    await guest.picture();

    // An edit of the host reaches the guest; a copy is the guest's own.
    await host.dragToZero("tf-band-4");
    await host.picture();
    await until("the edit arrives", SHORT_MILLIS, async () => Number(await guest.data("tf-point-4", "opacity")) === 0);
    await guest.key("g");
    await guest.opening(() => guest.at(`session-${letter}`).getByTestId("session-copy").click());
    await guest.picture();
    const copy = guest.session();
    assert.ok(![letter, host.session(), ballId].includes(copy));
    await host.key("z");
    assert.ok(difference(shown, await host.picture()).mean < 0.05);
    assert.equal(Number(await guest.data("tf-point-4", "opacity")), 0, "the copy stays as it was copied");

    // Sessions of one's own are joined, to edit, and ended.
    await guest.key("g");
    await guest.opening(() => guest.at(`session-${ball}`).getByTestId("session-join").click());
    assert.equal(guest.session(), ballId);
    await guest.picture();
    await guest.key("g");
    const copied = guest.at(`session-${await listedAs(copy)}`);
    await guest.opening(() => copied.getByTestId("session-join").click());
    assert.equal(guest.session(), copy);
    assert.equal(await guest.at("watch-bar").count(), 0);
    await guest.picture();
    await guest.key("g");
    await guest.at(`session-${ball}`).getByTestId("session-end").click();
    await guest.at("session-end-confirm").click();
    await until("the ended session is gone", SHORT_MILLIS, async () => (await guest.at(`session-${ball}`).count()) === 0);
    assert.deepEqual([...host.complaints, ...guest.complaints], []);
  });
}
