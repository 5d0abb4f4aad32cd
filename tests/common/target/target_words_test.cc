// SPDX-License-Identifier: Apache-2.0
#include "common/target/target_words.h"

#include <gtest/gtest.h>

namespace rigcal::target_words_test {
namespace {

TEST(TargetWords, SpeakOfTheBoard) {
  const Target board = *ParseTarget("board:checker,9x6,0.03");
  EXPECT_EQ(SpeakOf(board, "wave the wand where both see it. Wands and the wand's images: turn it"),
            "wave the board where both see it. Boards and the board's images: turn it");
  EXPECT_EQ(SpeakOf(board, "no wand: wave it"), "no board: wave it");
}

TEST(TargetWords, NamesStay) {
  const Target board = *ParseTarget("board:checker,9x6,0.03");
  for (const char* text : {"wrong_wand_length", "--target wand:0,0.13,0.39", "/data/wand/left.csv",
                           "ewand", "wander", ""}) {
    EXPECT_EQ(SpeakOf(board, text), text);
  }
}

TEST(TargetWords, TheWandIsTheWand) {
  EXPECT_EQ(SpeakOf(*ParseTarget("wand:0,0.13,0.39"), "wave the wand"), "wave the wand");
  EXPECT_EQ(SpeakOf(*ParseTarget("rigid:{A 0 0 0|B 1 0 0|C 0 1 0|D 0 0 1}"), "Wave the wand"),
            "Wave the target");
}

}  // namespace
}  // namespace rigcal::target_words_test
