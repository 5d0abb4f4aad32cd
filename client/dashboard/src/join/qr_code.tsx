// SPDX-License-Identifier: Apache-2.0
import type { JSX } from 'preact';
import { useMemo } from 'preact/hooks';
import qrcode from 'qrcode-generator';

/** The dark modules of a QR code as one SVG path, and its side in modules. */
export function qrPath(text: string): { path: string; side: number } {
  const code = qrcode(0, 'M');
  code.addData(text);
  code.make();
  const side = code.getModuleCount();
  let path = '';
  for (let row = 0; row < side; ++row) {
    for (let column = 0; column < side; ++column) {
      if (!code.isDark(row, column)) continue;
      let end = column;
      while (end + 1 < side && code.isDark(row, end + 1)) end += 1;
      path += `M${column} ${row}h${end - column + 1}v1H${column}z`;
      column = end;
    }
  }
  return { path, side };
}

/** A QR code, dark on white with the quiet zone that scanners need. */
export function QrCode({ text, label }: { text: string; label: string }): JSX.Element {
  const { path, side } = useMemo(() => qrPath(text), [text]);
  return <svg class="qr" viewBox={`-4 -4 ${side + 8} ${side + 8}`} role="img" aria-label={label} shape-rendering="crispEdges">
    <rect x={-4} y={-4} width={side + 8} height={side + 8} fill="#fff" /><path d={path} fill="#000" /></svg>;
}
