"use strict";
// What all pages share. Everything from outside reaches a page as text nodes only, never as markup.
const data = JSON.parse(document.getElementById("data").textContent);

function make(name, properties = {}, ...children) {
  const element = Object.assign(document.createElement(name), properties);
  element.append(...children.filter((c) => c !== undefined && c !== ""));
  return element;
}
const words = (text) => text.replaceAll("_", " ");

// Theme: the system's unless chosen.
const themes = ["system", "light", "dark"];
const themeButton = document.getElementById("theme");
function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  themeButton.textContent = "theme: " + theme;
  try { localStorage.setItem("robospa-theme", theme); } catch { /* not from disk in some browsers */ }
}
let stored = null;
try { stored = localStorage.getItem("robospa-theme"); } catch { /* as above */ }
setTheme(themes.includes(stored) ? stored : "system");
themeButton.hidden = false;
themeButton.addEventListener("click", () =>
  setTheme(themes[(themes.indexOf(document.documentElement.dataset.theme) + 1) % themes.length]));
