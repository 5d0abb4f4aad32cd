#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""No sentence stands twice in the guides: who mends one would have to know of the other."""
import collections
import unittest

import guides

_LONG = 9  # words

# `rigcal-agent sources --markdown` writes it: sources that share an option say the same of it.
_GENERATED = ("docs/sources.md",)


def repeated(pages):
    """{sentence: [name of a page, ...]} of those that stand more than once."""
    places = collections.defaultdict(list)
    for name, text in pages:
        for sentence in guides.sentences(text):
            if len(sentence.split()) >= _LONG:
                places[sentence].append(name)
    return {sentence: names for sentence, names in places.items() if len(names) > 1}


class SentencesTest(unittest.TestCase):
    maxDiff = None

    def test_no_sentence_stands_twice(self):
        self.assertEqual(repeated([page for page in guides.pages() if page[0] not in _GENERATED]), {})

    def test_a_repeated_sentence_is_found(self):
        said = "A sentence of more than eight words\nstands here for a test."
        pages = [("a.md", f"# A\n\nFirst. {said} Last.\n\n- {said}\n"), ("b.md", f"| a | {said.replace(chr(10), ' ')} |\n")]
        self.assertEqual(list(repeated(pages).values()), [["a.md", "a.md", "b.md"]])

    def test_code_and_short_sentences_may_repeat(self):
        said = "a line of code that has more than eight words in it"
        self.assertEqual(repeated([("a.md", f"```\n{said}\n```\n\n```\n{said}\n```\n\n    {said}\n\nAs said. As said.\n")]), {})


if __name__ == "__main__":
    unittest.main()
