// SPDX-License-Identifier: Apache-2.0
// Colours of the theme for what is drawn on canvases.

export interface Palette {
  theme: string;
  ink: string;
  faint: string;
  line: string;
  surface: string;
  accent: string;
  bad: string;
  warn: string;
  good: string;
}

let current: Palette | undefined;

/** The colours now. */
export function palette(): Palette {
  const root = document.documentElement;
  const theme = root.dataset['theme'] ?? 'dark';
  if (current?.theme !== theme) {
    const style = getComputedStyle(root);
    const read = (name: string) => style.getPropertyValue(name).trim();
    current = { theme, ink: read('--ink'), faint: read('--faint'), line: read('--line'), surface: read('--well'),
      accent: read('--accent'), bad: read('--bad'), warn: read('--warn'), good: read('--good') };
  }
  return current;
}
