/** What the mark of light that is on its way says, and what readers of screens are told of it. */

/** Writes it down from now on, with the epoch of the picture on screen. */
export const watchMarks = (page) =>
  page.evaluate(() => {
    window.lightMarks = [];
    const note = () => {
      const mark = document.querySelector("[data-testid=light-mark]");
      if (!mark) return;
      window.lightMarks.push({
        old: mark.dataset.old === "true",
        words: mark.innerText.replace(/\s+/g, " "),
        said: document.querySelector("[data-testid=light-said]").textContent,
        epoch: Number(document.querySelector("[data-testid=viewport]").dataset.epoch),
      });
    };
    new MutationObserver(note).observe(document.body, { subtree: true, childList: true, characterData: true, attributes: true });
  });

/** What was written down since it was last asked for. */
export const marksOf = (page) => page.evaluate(() => window.lightMarks.splice(0));
