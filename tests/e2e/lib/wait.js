/** Waiting with a bound. */

const POLL_MILLIS = 100;

export const pause = (millis) => new Promise((done) => setTimeout(done, millis));

/** Asks again and again until the answer is truthy, and returns it; fails in words after `millis`. */
export async function until(what, millis, ask) {
  const end = Date.now() + millis;
  for (;;) {
    const answer = await ask();
    if (answer) return answer;
    if (Date.now() > end) throw new Error(`${what}: not within ${millis / 1000} s`);
    await pause(POLL_MILLIS);
  }
}
