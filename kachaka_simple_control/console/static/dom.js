// Copyright 2026 kachaka_simple_control contributors, licensed under the Apache License 2.0.
/** Small helpers for the document. Text from outside is only ever set as textContent. */

const SVG = 'http://www.w3.org/2000/svg';
const TEXT_TYPES = ['text', 'search', 'email', 'number', 'password', 'tel', 'url'];

/**
 * Return the element with an id.
 * @param {string} id
 * @returns {HTMLElement}
 */
export function byId(id) {
  const element = document.getElementById(id);
  if (element === null) throw new Error(`the page has no element ${id}`);
  return element;
}

/**
 * Set the text of an element, only when it differs: a screen reader reads each change.
 * @param {Element} element
 * @param {string} text
 */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/**
 * Set a text and how it is shown.
 * @param {HTMLElement} element
 * @param {string} text
 * @param {'idle'|'good'|'busy'|'warn'|'bad'} tone
 */
export function setStatus(element, text, tone) {
  setText(element, text);
  if (element.dataset.tone !== tone) element.dataset.tone = tone;
}

/**
 * Create an element.
 * @param {string} name
 * @param {Object<string, string>} attributes
 * @param {string} [text]
 * @returns {HTMLElement}
 */
export function create(name, attributes = {}, text = '') {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text) element.textContent = text;
  return element;
}

/**
 * Create an element of an SVG picture.
 * @param {string} name
 * @param {Object<string, string|number>} attributes
 * @param {string} [text]
 * @returns {SVGElement}
 */
export function createSvg(name, attributes = {}, text = '') {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, String(value));
  if (text) element.textContent = text;
  return element;
}

/**
 * Return whether an element takes text, so that letters and space belong to it.
 * @param {Element|null} element
 */
export function takesText(element) {
  if (element === null) return false;
  if (element instanceof HTMLInputElement) return TEXT_TYPES.includes(element.type);
  return element.matches('textarea, select') || element.isContentEditable;
}

/**
 * Return whether an element is a control, which a press of space operates.
 * @param {Element|null} element
 */
export function isControl(element) {
  return element !== null &&
    (takesText(element) || element.matches('a[href], button, input, summary'));
}

/**
 * Offer a text as a file to download.
 * @param {string} file
 * @param {string} text
 */
export function offerDownload(file, text) {
  const url = URL.createObjectURL(new Blob([text], {type: 'application/yaml'}));
  const link = create('a', {href: url, download: file});
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}
