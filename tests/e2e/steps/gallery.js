import assert from "node:assert/strict";
import { difference } from "../lib/pixels.js";
import { FINAL_MILLIS, SHORT_MILLIS } from "../lib/page.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, theBall, theLetter } from "../lib/world.js";

export function gallerySteps() {
  step("gallery: a session is found, joined, copied and ended", async (arrive) => {
    const hash = await sessionOf(await theLetter());
    const host = await arrive({ hash });
    await host.key("ArrowRight");
    const shown = await host.picture();
    const letter = host.session();

    const guest = await arrive({ hash: await sessionOf(await theBall()) });
    const ball = guest.session();
    await guest.picture();
    await guest.key("g");
    const tile = guest.at(`session-${letter}`);
    await tile.waitFor();
    assert.match(await tile.innerText(), /letter[\s\S]*used just now[\s\S]*1 viewer/);
    await guest.context.grantPermissions(["clipboard-read", "clipboard-write"]);
    await tile.getByTestId("session-watch").click();
    await guest.page.getByText("Link copied").waitFor();
    const link = await guest.page.evaluate(() => navigator.clipboard.readText());
    assert.ok(link.startsWith(`${guest.origin}/#session=`) && !link.includes(letter), link);
    assert.equal(await guest.data(`session-${ball}`, "mine"), "true");
    await until("its picture", FINAL_MILLIS, async () => (await tile.locator(".gallery-picture").getAttribute("data-drawn")) === "true");
    await guest.opening(() => tile.getByTestId("session-join").click());
    assert.equal(guest.session(), letter);
    await guest.picture();

    // An edit of the host reaches the guest; a copy is the guest's own.
    await host.dragToZero("tf-band-4");
    await host.picture();
    await until("the edit arrives", SHORT_MILLIS, async () => Number(await guest.data("tf-point-4", "opacity")) === 0);
    await guest.key("g");
    await guest.opening(() => guest.at(`session-${letter}`).getByTestId("session-copy").click());
    await guest.picture();
    assert.ok(![letter, ball].includes(guest.session()));
    await host.key("z");
    assert.ok(difference(shown, await host.picture()).mean < 0.05);
    assert.equal(Number(await guest.data("tf-point-4", "opacity")), 0, "the copy stays as it was copied");

    await guest.key("g");
    await guest.at(`session-${ball}`).getByTestId("session-end").click();
    await guest.at("session-end-confirm").click();
    await until("the ended session is gone", SHORT_MILLIS, async () => (await guest.at(`session-${ball}`).count()) === 0);
    assert.deepEqual([...host.complaints, ...guest.complaints], []);
  });
}
