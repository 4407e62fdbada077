import assert from "node:assert/strict";
import axe from "axe-core";
import { SHORT_MILLIS } from "../lib/page.js";
import { until } from "../lib/wait.js";
import { sessionOf, step, world } from "../lib/world.js";

/** A sample that is drawn quickly. */
const SAMPLE = "smoke_plume";
/** What opens fades in, milliseconds: half-seen text would have too little contrast. */
const FADE_MILLIS = 400;
/** WCAG 2.2 up to level AA, and what axe calls best practice. */
const RULES = {
  runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"],
  // Menus and tooltips stand beside the landmarks by nature.
  rules: { region: { enabled: false } },
};

/** Times the linter looks before something it finds is believed: a tooltip may be fading in or out. */
const LOOKS = 3;

/** What the linter finds, in words. */
async function findings(visitor, looks = LOOKS) {
  const { violations } = await visitor.page.evaluate((rules) => globalThis.axe.run(document, rules), RULES);
  if (violations.length > 0 && looks > 1) {
    await visitor.page.waitForTimeout(FADE_MILLIS);
    return findings(visitor, looks - 1);
  }
  return violations.map(({ id, help, nodes }) => `${id}: ${help}: ${nodes.map(({ html }) => html.slice(0, 140)).join(" | ")}`);
}

/** What is open when the linter looks; the first one is the page as it comes. */
const states = {
  "the page": async () => {},
  "a point, a light and the handles": async (visitor) => {
    await visitor.at("tf-point-1").focus();
    await visitor.at("light-select-0").click();
    await visitor.at("light-add").click();
    await visitor.at("light-add-spot").click();
    await visitor.at("section-toggle-materials").click();
    await visitor.at("toggle-clip-handles").click();
    await visitor.at("toggle-windowing").click();
  },
  "an environment picture": async (visitor) => {
    await visitor.page.locator("[data-testid=lights] [data-type=environment] .light-name").click();
    await visitor.at("environment-overcast").click();
    await visitor.at("environment-strip").waitFor();
  },
  "links to share": (visitor) => visitor.at("share").click(),
  statistics: async (visitor) => {
    await visitor.key("Escape");
    await visitor.at("status-line").click();
  },
  "colour maps": async (visitor) => {
    await visitor.at("status-line").click();
    await visitor.at("tf-colours").click();
  },
  presets: async (visitor) => {
    await visitor.at("tf-colours").click();
    await visitor.at("tf-presets").click();
  },
  "the curve's menu": async (visitor) => {
    await visitor.at("tf-presets").click();
    await visitor.at("tf-menu").click();
  },
  turntable: async (visitor) => {
    await visitor.key("Escape");
    await visitor.at("turntable-open").click();
    await visitor.at("turntable-begin").waitFor();
  },
  film: async (visitor) => {
    await visitor.at("turntable-kind").getByText("Through saved views").click();
    await visitor.at("film-add").click();
    await visitor.at("film-view-1").waitFor();
  },
  gallery: async (visitor) => {
    await visitor.key("Escape");
    await visitor.at("gallery-open").click();
    await visitor.at("gallery-list").waitFor();
  },
  help: async (visitor) => {
    await visitor.key("Escape");
    await visitor.at("help").click();
    await visitor.at("help-sheet").getByText("Keys and gestures").waitFor();
  },
};

export function accessibilitySteps() {
  for (const colorScheme of ["dark", "light"]) {
    step(`accessibility: the linter finds nothing in the ${colorScheme} theme`, async (arrive) => {
      const visitor = await arrive({ hash: await sessionOf(SAMPLE), width: 1280, height: 900, colorScheme });
      await visitor.picture();
      await visitor.page.evaluate(axe.source);
      const found = {};
      for (const [state, open] of Object.entries(states)) {
        await open(visitor);
        await visitor.page.waitForTimeout(FADE_MILLIS);
        const here = await findings(visitor);
        if (here.length > 0) found[state] = here;
      }
      assert.deepEqual(found, {});
      assert.deepEqual(visitor.complaints, []);
    });
  }

  step("accessibility: the linter finds nothing where one watches", async (arrive) => {
    const [, id] = (await sessionOf(SAMPLE)).split("=");
    const { watch } = await world.server.json("GET", `sessions/${id}`);
    const found = {};
    for (const colorScheme of ["dark", "light"]) {
      const visitor = await arrive({ hash: `#session=${watch}`, width: 1280, height: 900, colorScheme });
      await visitor.at("watch-bar").waitFor();
      await visitor.picture();
      await visitor.page.evaluate(axe.source);
      found[colorScheme] = await findings(visitor);
    }
    assert.deepEqual(found, { dark: [], light: [] });
  });

  step("accessibility: the linter finds nothing on a telephone", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(SAMPLE), width: 390, height: 800, hasTouch: true, colorScheme: "light" });
    await visitor.picture();
    await visitor.page.evaluate(axe.source);
    const found = { page: await findings(visitor) };
    for (const side of ["left", "right"]) {
      await visitor.at(`toggle-${side}`).click();
      await visitor.page.waitForTimeout(FADE_MILLIS);
      found[side] = await findings(visitor);
    }
    assert.deepEqual(found, { page: [], left: [], right: [] });
  });

  step("theme: follows the system, until the other one is chosen", async (arrive) => {
    const visitor = await arrive({ hash: await sessionOf(SAMPLE) });
    await visitor.picture();
    const theme = () => visitor.page.locator("html").getAttribute("data-mantine-color-scheme");
    const becomes = (wanted) => until(`the ${wanted} theme`, SHORT_MILLIS, async () => (await theme()) === wanted);
    assert.equal(await theme(), "dark");
    await visitor.page.emulateMedia({ colorScheme: "light" });
    await becomes("light");
    await visitor.at("toggle-theme").click();
    await becomes("dark");
    await visitor.page.reload();
    await becomes("dark");
    await visitor.at("toggle-theme").click();
    await becomes("light");
    await visitor.page.emulateMedia({ colorScheme: "dark" });
    await becomes("dark");
  });
}
