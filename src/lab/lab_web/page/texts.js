// SPDX-License-Identifier: BSD-3-Clause
// The page's texts, from texts/LANGUAGE.json; elements name theirs by data-text, data-title, data-label and data-hint.
export const LANGUAGES = {en: "English", zh: "中文"};
let texts = {};

export async function load(language) {
  const answer = await fetch(`page/texts/${language}.json`);
  texts = await answer.json();
  document.documentElement.lang = language;
  document.title = texts.title;
  translate(document);
}

export function translate(root) {
  for (const element of root.querySelectorAll("[data-text]")) element.textContent = text(element.dataset.text);
  for (const element of root.querySelectorAll("[data-title]")) element.title = text(element.dataset.title);
  for (const element of root.querySelectorAll("[data-hint]")) element.placeholder = text(element.dataset.hint);
  for (const element of root.querySelectorAll("[data-label]")) {
    element.setAttribute("aria-label", text(element.dataset.label));
  }
}

export const has = (key) => key in texts;

export function text(key, values = {}) {
  return Object.entries(values).reduce((found, [name, value]) => found.replace(`{${name}}`, () => value),
                                       texts[key] ?? key);
}
