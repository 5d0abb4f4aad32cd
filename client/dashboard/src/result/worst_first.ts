// SPDX-License-Identifier: Apache-2.0
// In which order the cameras of a large result are listed, and which of them a person looks for.
import type { CalibratedCamera, Finding } from '../api/types';

const severities: Record<string, number> = { FINDING_SEVERITY_ERROR: 3, FINDING_SEVERITY_WARNING: 2, FINDING_SEVERITY_INFO: 1 };

/** Cameras with findings, the gravest first, then by their error on what was held out, the largest first. */
export function worstFirst(cameras: readonly CalibratedCamera[], findings: readonly Finding[]): CalibratedCamera[] {
  const gravest = new Map<string, number>();
  for (const finding of findings) {
    if (!finding.camera) continue;
    gravest.set(finding.camera, Math.max(gravest.get(finding.camera) ?? 0, severities[finding.severity ?? ''] ?? 0));
  }
  const of = (camera: CalibratedCamera): number => gravest.get(camera.camera ?? '') ?? 0;
  return [...cameras].sort((a, b) => of(b) - of(a) || (b.held_out?.mean_px ?? 0) - (a.held_out?.mean_px ?? 0)
    || (a.camera ?? '').localeCompare(b.camera ?? '', 'en', { numeric: true }));
}

/** Those in whose names every word of `text` is. */
export function named<Item>(items: readonly Item[], nameOf: (item: Item) => string, text: string): Item[] {
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  return items.filter((item) => words.every((word) => nameOf(item).toLowerCase().includes(word)));
}
