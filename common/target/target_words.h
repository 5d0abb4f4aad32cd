// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "common/target/target.h"

namespace rigcal {

// What people call a target of this kind: "wand", also where it is one point of it; "board";
// "target" of any other rigid body, and of static points.
std::string_view TargetWord(const Target& target);

// Texts are written for the wand, which most rigs use. The same text about this target: the words
// "wand" and "wands" become its word, capital letters kept. Names such as `wrong_wand_length` and
// paths stay.
std::string SpeakOf(const Target& target, std::string text);

}  // namespace rigcal
