// SPDX-License-Identifier: Apache-2.0
// The frame around all pages: navigation, connection, theme.
import type { JSX } from 'preact';
import { useEffect, useRef, useState } from 'preact/hooks';
import { hasDocs, listAgents } from '../api/server_api';
import { JoinPage } from '../join/join_page';
import { LoginPage } from '../join/login_page';
import { LensPage } from '../lens/lens_page';
import { RecordsPage } from '../records/records_page';
import { ResultPage } from '../result/result_page';
import { RigPage } from '../rig/rig_page';
import { DistancePage } from '../wave/distance_page';
import { sessionState } from '../wave/session_controls';
import { WavePage } from '../wave/wave_page';
import { Banner } from './banner';
import { useFeed, useFeedControl } from './feed_context';
import { Chip } from './parts';
import { hashOf, type Page, pages, type Route, routeOf } from './route';
import { changeSettings, readSettings } from './settings';
import { useLoaded } from './use_async';

const titles: Record<(typeof pages)[number], readonly [string, string]> = {
  wave: ['Wave', 'M3 17L17 5M3 17m-2 0a2 2 0 1 0 4 0a2 2 0 1 0-4 0M9 12m-2 0a2 2 0 1 0 4 0a2 2 0 1 0-4 0M17 5m-2 0a2 2 0 1 0 4 0a2 2 0 1 0-4 0'],
  result: ['Result', 'M3 3v14h14M6 13l3-4 3 2 5-6'],
  rig: ['Rig', 'M2 6h9v8H2zM11 9l6-3v8l-6-3'],
  lens: ['Lens', 'M10 10m-7 0a7 7 0 1 0 14 0a7 7 0 1 0-14 0M10 10m-3 0a3 3 0 1 0 6 0a3 3 0 1 0-6 0'],
  records: ['Sessions', 'M3 5h14M3 10h14M3 15h14'],
  join: ['Join', 'M10 4v12M4 10h12'],
};

function useRoute(): Route {
  const [route, setRoute] = useState(() => routeOf(location));
  useEffect(() => {
    const change = () => setRoute(routeOf(location));
    window.addEventListener('hashchange', change);
    return () => window.removeEventListener('hashchange', change);
  }, []);
  return route;
}

/** Rigs that agents have cameras for; shown only where there are several. */
function RigChoice(): JSX.Element | null {
  const feed = useFeedControl();
  const { rig } = useFeed();
  const agents = useLoaded('rigs', (signal) => listAgents(signal), 15000);
  const names = [...new Set([...(agents.value?.agents ?? []).map((agent) => agent.rig ?? ''), rig.rig])].filter(Boolean).sort();
  if (names.length < 2) return null;
  return <label class="rigchoice">Rig <select value={rig.rig} onChange={(event) => {
    changeSettings({ rig: event.currentTarget.value });
    feed.setRig(event.currentTarget.value);
  }}>{names.map((name) => <option key={name}>{name}</option>)}</select></label>;
}

/** The documentation, where the server has it. */
function DocsLink(): JSX.Element | null {
  const docs = useLoaded('docs', (signal) => hasDocs(signal));
  return docs.value ? <a class="docs wideonly" href="/docs/" target="_blank" rel="noopener">Docs</a> : null;
}

function Connection(): JSX.Element {
  const { stale, answeredAt, rig } = useFeed();
  const [mark, word] = sessionState(rig.session);
  if (stale) return <Chip mark="bad">{answeredAt === undefined ? 'no answer' : 'old data'}</Chip>;
  if (answeredAt === undefined) return <Chip mark="idle">connecting</Chip>;
  return rig.session?.state === 'STATE_CAPTURING' ? <Chip mark={mark}>{word}</Chip> : <Chip mark="good">connected</Chip>;
}

/** The whole page. */
export function App(): JSX.Element {
  const route = useRoute();
  const { needsLogin } = useFeed();
  const [theme, setTheme] = useState(readSettings().theme);
  const main = useRef<HTMLElement>(null);
  const page: Page = needsLogin ? 'login' : route.page;
  const last = useRef(page);
  document.documentElement.dataset['theme'] = theme;
  useEffect(() => {
    const title = page === 'login' ? 'Login' : page === 'distance' ? 'Distance mode' : titles[page][0];
    document.title = `${title} · rigcal`;
    if (last.current !== page) {
      // A new page begins at its top, for keyboards and screen readers, too.
      scrollTo(0, 0);
      (main.current ?? document.getElementById('main'))?.focus({ preventScroll: true });
    }
    last.current = page;
  }, [page]);
  if (page === 'distance') return <DistancePage />;
  return <>
    <a class="skip" href="#main" onClick={(event) => {
      event.preventDefault();
      main.current?.focus();
    }}>To the content</a>
    <header class="top">
      <a class="brand" href={hashOf('wave')}><svg width="22" height="22" viewBox="0 0 32 32" aria-hidden="true">
        <path d="M7 24L25 9" /><circle cx="7" cy="24" r="3.4" /><circle cx="13" cy="19" r="3.4" /><circle cx="25" cy="9" r="3.4" /></svg>
      <span>rigcal</span></a>
      <nav aria-label="Pages">{pages.map((name) => <a key={name} href={hashOf(name)} aria-current={page === name ? 'page' : undefined}>
        <svg width="20" height="20" viewBox="0 0 20 20" aria-hidden="true"><path d={titles[name][1]} /></svg><span>{titles[name][0]}</span></a>)}</nav>
      <div class="right"><DocsLink /><RigChoice /><Connection />
        <button type="button" class="quiet" aria-pressed={theme === 'light'} onClick={() =>
          setTheme(changeSettings({ theme: theme === 'dark' ? 'light' : 'dark' }).theme)}>
          <span aria-hidden="true">◐</span><span class="wideonly"> Light</span><span class="hidden narrowonly"> Light theme</span></button></div>
    </header>
    <Banner />
    <main id="main" ref={main} tabIndex={-1}>
      <h1 class="hidden">{page === 'login' ? 'Login' : titles[page][0]}</h1>
      {page === 'wave' && <WavePage theme={theme} />}
      {page === 'result' && <ResultPage route={route} theme={theme} />}
      {page === 'rig' && <RigPage />}
      {page === 'lens' && <LensPage route={route} theme={theme} />}
      {page === 'records' && <RecordsPage route={route} />}
      {page === 'join' && <JoinPage />}
      {page === 'login' && <LoginPage route={route} />}
    </main>
  </>;
}
