// SPDX-License-Identifier: Apache-2.0
// The search box. The index is a script that is loaded when the box is first used, so that it works
// from a disk, too.
'use strict';
(() => {
  const base = document.currentScript.dataset.base;
  const box = document.getElementById('search');
  const list = document.getElementById('found');
  const most = 12;
  const snippetLength = 170;
  // What people type, and what the pages call it.
  const alike = {
    busy: ['use', 'taken'], moved: ['bumped', 'move'], bumped: ['moved'], pcs: ['computers', 'machines'], pc: ['computer', 'machine'],
    two: ['several'], multiple: ['several'], computer: ['pc'], computers: ['pcs'], grade: ['quality'], blender: ['export'],
    error: ['fault'], stuck: ['waits', 'hangs'], shutter: ['exposure'], chessboard: ['board'], checkerboard: ['board'],
  };
  let loading;
  let entries;
  let index;

  // Guides come before lists and figures, those before messages and files.
  function weightOf(location) {
    if (/^(reference|files|commands)\//.test(location)) return 0.4;
    return /^(sources|accuracy|performance|fuzzing|ARCHITECTURE)\./.test(location) ? 0.6 : 1;
  }

  function load() {
    loading ??= new Promise((resolve, reject) => {
      const script = document.createElement('script');
      script.src = `${base}/search/search_index.js`;
      script.onload = resolve;
      script.onerror = () => reject(new Error('the index of the search is missing'));
      document.head.append(script);
    }).then(() => {
      const text = document.createElement('textarea');
      const plain = (html) => {
        text.innerHTML = html;  // the index has &lt; for <; a textarea runs nothing
        return text.value;
      };
      const pages = {};
      entries = {};
      for (const { location, title, text: body } of window.searchIndex.docs) {
        const page = location.split('#')[0];
        if (!location.includes('#')) pages[page] = plain(title);
        // A page as a whole has the text of its sections once more.
        else entries[location] = { title: plain(title), text: plain(body), page };
      }
      for (const entry of Object.values(entries)) entry.pageTitle = pages[entry.page];
      index = lunr(function () {
        this.ref('location');
        this.field('title', { boost: 6 });
        this.field('pageTitle', { boost: 3 });
        this.field('text');
        for (const [location, entry] of Object.entries(entries)) {
          this.add({ location, ...entry }, { boost: weightOf(location) });
        }
      });
    });
    return loading;
  }

  function wordsOf(query) {
    const words = query.toLowerCase().split(/[^\p{L}\p{N}_]+/u).filter(Boolean);
    const telling = words.filter((word) => lunr.stopWordFilter(word) && !['does', 'mean', 'which'].includes(word));
    return telling.length > 0 ? telling : words;
  }

  function find(words) {
    const score = new Map();
    words.forEach((word, place) => {
      const results = index.query((query) => {
        query.term(word, { boost: 10 });
        for (const other of alike[word] ?? []) query.term(other, { boost: 4 });
        if (place === words.length - 1 && word.length > 1) {
          query.term(word, { wildcard: lunr.Query.wildcard.TRAILING, usePipeline: false });
        }
      });
      const best = results[0]?.score ?? 1;
      for (const { ref, score: own } of results) {
        // A section with every word comes before one that has a single word often.
        const sum = score.get(ref) ?? { words: 0, score: 0 };
        score.set(ref, { words: sum.words + 1, score: sum.score + own / best });
      }
    });
    if (score.size === 0) {
      // Perhaps it is spelled differently.
      for (const { ref, score: own } of index.query((query) => words.forEach((word) => query.term(word, { editDistance: 1 })))) {
        score.set(ref, { words: 1, score: own });
      }
    }
    return [...score].sort(([, a], [, b]) => b.words - a.words || b.score - a.score).slice(0, most).map(([ref]) => ref);
  }

  // The text with what was searched for marked.
  function marked(element, text, words) {
    const wanted = words.flatMap((word) => [word, ...(alike[word] ?? [])]).map((word) => word.replace(/[^\p{L}\p{N}_]/gu, ''));
    for (const piece of text.split(new RegExp(`\\b((?:${wanted.join('|')})[\\p{L}\\p{N}_]*)`, 'iu')).entries()) {
      const [place, words] = piece;
      const node = place % 2 ? document.createElement('mark') : document.createTextNode(words);
      if (place % 2) node.textContent = words;
      element.append(node);
    }
    return element;
  }

  function snippet(text, words) {
    const at = words.map((word) => text.toLowerCase().indexOf(word)).filter((place) => place >= 0);
    const begin = Math.max(0, Math.min(...at, text.length) - 50);
    const from = at.length === 0 || begin === 0 ? 0 : text.indexOf(' ', begin) + 1;
    return (from > 0 ? '… ' : '') + text.slice(from, from + snippetLength) + (text.length > from + snippetLength ? ' …' : '');
  }

  function show(query) {
    const words = wordsOf(query);
    const found = words.length === 0 ? [] : find(words);
    list.replaceChildren(...found.map((location) => {
      const entry = entries[location];
      const link = document.createElement('a');
      link.href = `${base}/${location}`;
      const title = document.createElement('b');
      title.textContent = entry.title;
      const page = document.createElement('span');
      page.textContent = entry.title === entry.pageTitle ? '' : ` · ${entry.pageTitle}`;
      link.append(title, page, marked(document.createElement('small'), snippet(entry.text, words), words));
      return link;
    }));
    if (found.length === 0 && words.length > 0) {
      const nothing = document.createElement('p');
      nothing.textContent = 'Nothing found. Try fewer words, or a word of the glossary.';
      list.append(nothing);
    }
    list.hidden = words.length === 0;
  }

  async function update() {
    try {
      await load();
      show(box.value);
    } catch (error) {
      list.textContent = error.message;
      list.hidden = false;
    }
  }

  box.addEventListener('focus', load);
  box.addEventListener('input', update);
  box.addEventListener('keydown', (event) => {
    if (event.key === 'Enter') list.querySelector('a')?.click();
    if (event.key === 'ArrowDown') list.querySelector('a')?.focus();
  });
  list.addEventListener('keydown', (event) => {
    const link = document.activeElement;
    const next = { ArrowDown: link.nextElementSibling, ArrowUp: link.previousElementSibling ?? box }[event.key];
    if (next) {
      event.preventDefault();
      next.focus();
    }
  });
  document.addEventListener('keydown', (event) => {
    if (event.key === '/' && document.activeElement !== box) {
      event.preventDefault();
      box.focus();
    }
    if (event.key === 'Escape') list.hidden = true;
  });
  document.addEventListener('click', (event) => {
    if (!event.target.closest('.search')) list.hidden = true;
    else if (list.contains(event.target.closest('a'))) list.hidden = true;
  });
})();
