// SPDX-License-Identifier: Apache-2.0
// Small parts that all pages have.
import type { ComponentChildren, JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { errorText } from '../api/server_api';

/** How good something is; each has a symbol, so that colour is never alone. */
export type Mark = 'good' | 'warn' | 'bad' | 'idle' | 'info' | 'live';
const symbols: Record<Mark, string> = { good: '✓', warn: '▲', bad: '✕', idle: '○', info: 'i', live: '●' };

/** Symbol and word. */
export function Chip({ mark, children }: { mark: Mark; children: ComponentChildren }): JSX.Element {
  return <span class={`chip ${mark}`}><span class="symbol" aria-hidden="true">{symbols[mark]}</span>{children}</span>;
}

/** A part of a page with a heading. */
export function Panel({ title, aside, children, name }: {
  title: string; aside?: ComponentChildren; children: ComponentChildren; name?: string;
}): JSX.Element {
  return <section class={`panel ${name ?? ''}`} aria-label={title}>
    <header><h2>{title}</h2>{aside !== undefined && <div class="aside">{aside}</div>}</header>
    {children}
  </section>;
}

/** A name and its value. */
export function Fact({ name, children, title }: { name: string; children: ComponentChildren; title?: string }): JSX.Element {
  return <div class="fact" title={title}><dt>{name}</dt><dd>{children}</dd></div>;
}

/** What went wrong, where it was asked for. */
export function Problem({ text }: { text: string }): JSX.Element | null {
  return text === '' ? null : <p class="problem" role="alert"><span aria-hidden="true">✕</span> {text}</p>;
}

/** A bar of 0 to 1, with its words. */
export function Meter({ share, label }: { share: number; label: string }): JSX.Element {
  return <progress class="meter" max={1} value={Math.min(1, Math.max(0, share))} aria-label={label} />;
}

/** A button whose work takes time: it cannot be pressed twice, and says what went wrong. */
export function WorkButton({ work, children, kind, disabled, label }: {
  work: () => Promise<void>; children: ComponentChildren; kind?: 'primary' | 'danger' | 'quiet'; disabled?: boolean;
  label?: string;
}): JSX.Element {
  const [busy, setBusy] = useState(false);
  const [problem, setProblem] = useState('');
  const here = useRef(true);
  useEffect(() => {
    here.current = true;
    return () => { here.current = false; };
  }, []);
  const press = async (): Promise<void> => {
    setBusy(true);
    setProblem('');
    try {
      await work();
    } catch (error) {
      if (here.current) setProblem(errorText(error));
    }
    if (here.current) setBusy(false);
  };
  return <span class="work">
    <button type="button" class={kind ?? ''} disabled={busy || disabled} aria-busy={busy} aria-label={label}
      onClick={() => void press()}>{children}</button>
    <Problem text={problem} />
  </span>;
}

/** Asks before something cannot be undone. */
export function Confirm({ question, detail, verb, onYes, onClose }: {
  question: string; detail: string; verb: string; onYes: () => Promise<void>; onClose: () => void;
}): JSX.Element {
  const dialog = useRef<HTMLDialogElement>(null);
  useEffect(() => dialog.current?.showModal(), []);
  return <dialog ref={dialog} onClose={onClose} aria-labelledby="confirm-question">
    <h2 id="confirm-question">{question}</h2>
    <p>{detail}</p>
    <div class="buttons">
      <button type="button" autofocus onClick={() => dialog.current?.close()}>Keep</button>
      <WorkButton kind="danger" work={async () => {
        await onYes();
        dialog.current?.close();
      }}>{verb}</WorkButton>
    </div>
  </dialog>;
}

/** A text with a button that copies it. */
export function Copyable({ text, label }: { text: string; label: string }): JSX.Element {
  const [copied, setCopied] = useState('');
  const copy = async (): Promise<void> => {
    try {
      await navigator.clipboard.writeText(text);
      setCopied('Copied');
    } catch {
      setCopied('Select it and copy by hand');
    }
  };
  return <div class="copyable">
    <code tabIndex={0} aria-label={label}>{text}</code>
    <button type="button" onClick={() => void copy()} aria-label={`Copy: ${label}`}>Copy</button>
    <span role="status">{copied}</span>
  </div>;
}

/** Gives the browser a file to save. */
export function saveFile(name: string, type: string, content: string): void {
  const address = URL.createObjectURL(new Blob([content], { type }));
  const link = document.createElement('a');
  link.href = address;
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}
