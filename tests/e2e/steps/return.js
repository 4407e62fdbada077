import assert from "node:assert/strict";
import { isMagenta } from "../lib/colours.js";
import { difference, region } from "../lib/pixels.js";
import { sessionOf, step, theLetter } from "../lib/world.js";

/** Two pictures of one scene: the mean channel differs by less. */
const SAME = 0.05;

export function returnSteps() {
  step("return: a reload and a shared link show the same scene", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(await theLetter()) });
    const start = await visitor.picture();
    await visitor.drag("viewport", [0.4, 0.5], [0.55, 0.45]);
    await visitor.dragToZero("tf-band-4");
    const edited = await visitor.picture();
    assert.ok(difference(start, edited).mean > 1, "the edits are seen");
    assert.equal(region(edited, isMagenta).share, 0);

    const session = visitor.session();
    await visitor.page.reload();
    const reloaded = await visitor.picture();
    assert.equal(visitor.session(), session);
    assert.ok(difference(edited, reloaded).mean < SAME, "after the reload");
    assert.equal(Number(await visitor.data("tf-point-4", "opacity")), 0);

    await visitor.context.grantPermissions(["clipboard-read", "clipboard-write"]);
    await visitor.at("share").click();
    await visitor.at("share-scene").click();
    await visitor.page.getByText("Link copied").waitFor();
    const link = await visitor.page.evaluate(() => navigator.clipboard.readText());
    assert.ok(link.startsWith(`${visitor.origin}/#scene=`), link);

    const guest = await arrive({ hash: link.slice(link.indexOf("#")) });
    const shared = await guest.picture();
    assert.notEqual(guest.session(), session, "the guest has a session of their own");
    assert.ok(difference(edited, shared).mean < SAME, "in another browser");
    assert.deepEqual([...visitor.complaints, ...guest.complaints], []);
  });
}
