"use strict";
// The page while its part is watched: waits for the next one and takes it in place. Camera, section, tab and selection
// stay. A version has several pages if the first is shown before all is known.

class Live {
  constructor() {
    this.note(document);
    this.root = location.pathname.replace(/[^/]*$/, "");
    this.bar = $("live");
  }
  /** Which page this is. */
  note(page) {
    const { version, number } = page.documentElement.dataset;
    this.version = +version;
    this.number = +number;
  }
  /** Waits for pages for as long as the page is open. */
  async follow() {
    for (let said = -1; ;) {
      try {
        const answer = await fetch(`${this.root}state?after=${said}`, { cache: "no-store" });
        if (!answer.ok) throw new Error(`status ${answer.status}`);
        const state = await answer.json();
        said = state.number;
        if (state.page > this.number) await this.take();
        this.say(state);
      } catch (error) {
        this.say({ kind: "lost", words: `no answer from deepmill watch (${error.message})`, changes: [] });
        said = -1;
        await new Promise((done) => setTimeout(done, 1000));
      }
    }
  }
  /** Takes the newest page. */
  async take() {
    const answer = await fetch(`${this.root}page`, { cache: "no-store" });
    if (!answer.ok) throw new Error(`status ${answer.status}`);
    const next = new DOMParser().parseFromString(await answer.text(), "text/html");
    const side = $("side"), scrolled = side.scrollTop;
    const open = [...side.querySelectorAll("details")].map((d) => d.open);
    for (const id of ["about", "block"]) $(id).textContent = next.getElementById(id).textContent;
    for (const which of ["h1", "header p", "#side"]) {
      const [now, then] = [document, next].map((page) => page.querySelector(which));
      now.replaceChildren(...[...then.childNodes].map((node) => document.importNode(node, true)));
    }
    document.title = next.title;
    side.querySelectorAll("details").forEach((d, i) => { if (i < open.length) d.open = open[i]; });
    const { report } = window;
    if (report.viewer) report.viewer.take(await load());
    else plainTabs();
    side.scrollTop = scrolled;
    this.note(next);
  }
  say({ kind, words, changes }) {
    const line = (text) => { const p = document.createElement("p"); p.textContent = text; return p; };
    this.bar.dataset.kind = kind;
    this.bar.replaceChildren(line(words), ...changes.map(line));
  }
}

window.report.live = new Live();
window.report.ready.then(() => window.report.live.follow());
