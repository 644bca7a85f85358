// A run that is still going: the page is asked for again, and what changed in it is put in place.
const liveLine = document.getElementById("live");
let tag = "";
const PARTS = ["summary", "videos", "tables", "figures", "runs"]; // trials come as data

function keepState(fresh, old) {
  const mark = old.querySelector("#intervals");
  if (mark && fresh.querySelector("#intervals")) fresh.querySelector("#intervals").checked = mark.checked;
  const before = old.querySelectorAll("details");
  fresh.querySelectorAll("details").forEach((d, n) => { if (before[n]?.open) d.open = true; });
}
function put(page) {
  for (const name of PARTS) {
    const fresh = page.getElementById(name);
    const old = document.getElementById(name);
    if (!fresh || (old && name === "videos")) continue; // films stay: one of them may be playing
    const next = document.importNode(fresh, true);
    if (!old) document.getElementById(name === "videos" ? "tables" : "trials").before(next);
    else if (old.outerHTML !== next.outerHTML) {
      keepState(next, old);
      old.replaceWith(next);
    }
  }
  document.querySelector("nav div").replaceChildren(...document.importNode(page.querySelector("nav div"), true).childNodes);
  for (const badge of document.querySelectorAll("header .badge")) badge.remove();
  document.querySelector("header").append(...[...page.querySelectorAll("header .badge")].map((b) => document.importNode(b, true)));
  Object.assign(data, JSON.parse(page.getElementById("data").textContent));
  haystacks.clear();
  fillFilters();
  showFilms();
  if (!body.querySelector("tr.detail")) { // an opened trial stays as it is
    const seed = document.activeElement?.closest?.("#list tr.row")?.dataset.trial;
    filter(start);
    if (seed) body.querySelector(`tr[data-trial="${seed}"] button`)?.focus({ preventScroll: true });
  }
}
function tell() {
  const done = data.trials.filter((t) => !["not run", "missing"].includes(t.end)).length;
  const now = new Date().toLocaleTimeString();
  liveLine.textContent = `${done} of ${data.trials.length} trials have a result; updated at ${now}`;
}
async function again() {
  let wait = 3000;
  if (!document.hidden) {
    const begun = performance.now();
    try {
      const answer = await fetch("/", { cache: "no-store", headers: tag ? { "If-None-Match": tag } : {} });
      if (answer.status === 200) {
        tag = answer.headers.get("ETag") || "";
        put(new DOMParser().parseFromString(await answer.text(), "text/html"));
      } else if (answer.status !== 304) throw new Error(await answer.text());
      tell();
    } catch (error) {
      liveLine.textContent = "Not live any more: " + error.message + ". The page shows the last state.";
    }
    wait = Math.max(wait, 5 * (performance.now() - begun));
  }
  setTimeout(again, wait);
}
tell();
setTimeout(again, 1000);
