/** What every test shares, and how a test is written: `step(name, async (arrive) => ...)`. */

import { it } from "node:test";
import { artifact } from "./artifacts.js";
import { Visitor } from "./page.js";
import { ball, letterL } from "./volumes.js";

/** Longest test, milliseconds. */
const STEP_MILLIS = 180_000;

/** Samples a pixel of finished pictures: more than one, so that they are refined; software devices are slow. */
const SAMPLES = 2;

/** The service and the browser; there while tests run. */
export const world = { server: null, browser: null };

const stored = new Map();
/** Stores a volume once, beside the page; returns its identifier. */
async function store(name, bytes) {
  if (!stored.has(name)) stored.set(name, (await world.server.upload(name, bytes())).id);
  return stored.get(name);
}

export const theLetter = () => store("letter.nii", letterL);
export const theBall = () => store("ball.nii", ball);

/**
 * Opens a dataset as the service would show it, but with few samples a pixel; returns what to append
 * to the address.
 */
export async function sessionOf(dataset) {
  const { id } = await world.server.json("POST", "sessions", { dataset });
  await world.server.json("PATCH", `sessions/${id}/scene`, { sampling: { samples_per_pixel: SAMPLES } });
  return `#session=${id}`;
}

/**
 * One test. `arrive(options)` opens the page as a new visitor, who leaves when the test ends; a test
 * that fails leaves a screenshot of every visitor's page.
 */
export function step(name, run) {
  it(name, { timeout: STEP_MILLIS }, async (context) => {
    const visitors = [];
    const arrive = async (options) => {
      const visitor = await Visitor.arrive(world.browser, world.server.origin, options);
      visitors.push(visitor);
      return visitor;
    };
    try {
      await run(arrive, context);
    } catch (error) {
      const file = name.replace(/\W+/g, "-").slice(0, 60);
      for (const [index, { page }] of visitors.entries()) {
        await page.screenshot({ path: artifact(`failed-${file}-${index}.png`) }).catch(() => {});
      }
      throw error;
    } finally {
      await Promise.all(visitors.map((visitor) => visitor.leave()));
    }
  });
}
