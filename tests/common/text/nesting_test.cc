// SPDX-License-Identifier: Apache-2.0
#include "common/text/nesting.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace rigcal::testing::nesting_test {
namespace {

using ::testing::Optional;

std::string Repeated(const std::string& text, size_t count) {
  std::string all;
  for (size_t i = 0; i < count; ++i) all += text;
  return all;
}

// "begin", `count` times.
struct Nest {
  NestedFormat format;
  std::string begin;
  std::string level;
  std::string end = "";
};

// Each level of indentation one column deeper.
std::string Indented(size_t levels) {
  std::string text;
  for (size_t i = 0; i < levels; ++i) text += std::string(i, ' ') + "a:\n";
  return text;
}

const std::vector<Nest>& Nests() {
  using enum NestedFormat;
  static const auto* const kNests = new std::vector<Nest>{
      {kJson, "", "["},
      {kJson, "", R"({"a":)"},
      {kJson, "[1, \"]\", ", "[ "},
      {kJson, "", R"(["]",)"},  // what is in a text closes nothing
      {kJson, "", R"(["\"]",)"},
      {kToml, "a = ", "["},
      {kToml, "a = ", "{a = "},
      {kToml, "", "a.", "a = 1"},
      {kToml, "", "\"a\" . ", "a = 1"},
      {kToml, "[", "a.", "a]\nb = 1"},
      {kToml, "[[", "a.", "a]]\nb = 1"},
      {kToml, "x = 1\n[", "'a'.", "a]"},
      {kToml, "x = ", "['''a''''', "},
      {kToml, "x = ", "[\"]\", "},
      {kToml, "x = ", "[ # ]\n"},
      {kToml, "x = ", "{a.b = [1.5, "},
      {kYaml, "a: ", "["},
      {kYaml, "a: ", "{a: "},
      {kYaml, "a: ", "[\"]\", "},
      {kYaml, "a: ", "[ # ]\n"},
      {kYaml, "a: ", "[it's ']', "},
      {kYaml, "", "- ", "a"},
      {kYaml, "", "? ", "a"},
      {kXml, "", "<a>"},
      {kXml, "<?xml version='1.0'?>", "<a b='/>'>"},
      {kXml, "", "<a><!-- </a> -->"},
      {kXml, "", "<a><![CDATA[</a>]]>"},
      {kXml, "", "<a>\n<b/>"},
  };
  return *kNests;
}

TEST(Nesting, FiftyThousandLevelsAreTooDeepInEveryWayOfWriting) {
  for (const Nest& nest : Nests()) {
    SCOPED_TRACE(nest.begin + nest.level);
    EXPECT_TRUE(
        LineNestedTooDeep(nest.format, nest.begin + Repeated(nest.level, 50'000) + nest.end));
    EXPECT_TRUE(LineNestedTooDeep(nest.format,
                                  nest.begin + Repeated(nest.level, kMostNested + 1) + nest.end));
    EXPECT_FALSE(LineNestedTooDeep(nest.format, nest.begin + Repeated(nest.level, 20) + nest.end));
  }
  EXPECT_TRUE(LineNestedTooDeep(NestedFormat::kYaml, Indented(kMostNested + 1)));
  EXPECT_FALSE(LineNestedTooDeep(NestedFormat::kYaml, Indented(kMostNested)));
}

TEST(Nesting, BracketsAndDotsOfTomlAddUp) {
  const std::string header = "[" + Repeated("a.", 30) + "a]\n";
  EXPECT_FALSE(LineNestedTooDeep(NestedFormat::kToml, header + Repeated("a.", 30) + "a = 1\n"));
  EXPECT_TRUE(LineNestedTooDeep(NestedFormat::kToml, header + Repeated("a.", 40) + "a = 1\n"));
  EXPECT_TRUE(LineNestedTooDeep(NestedFormat::kToml, header + "a = " + Repeated("[", 40)));
  EXPECT_TRUE(LineNestedTooDeep(NestedFormat::kToml, "a = " + Repeated("{b.b.b = ", 25)));
  EXPECT_FALSE(
      LineNestedTooDeep(NestedFormat::kToml, header + "[b]\n" + Repeated("a.", 50) + "a=1"));
}

TEST(Nesting, TheLineIsNamed) {
  EXPECT_THAT(LineNestedTooDeep(NestedFormat::kJson, "\n\n" + Repeated("[", 100)), Optional(3));
  EXPECT_THAT(LineNestedTooDeep(NestedFormat::kToml, "x = '''\n\n'''\n[" + Repeated("a.", 100)),
              Optional(4));
  EXPECT_THAT(LineNestedTooDeep(NestedFormat::kYaml, "a: 1\nb: " + Repeated("[", 100)),
              Optional(2));
  EXPECT_THAT(LineNestedTooDeep(NestedFormat::kXml, "<!--\n-->\n" + Repeated("<a>", 100)),
              Optional(3));
}

// Long and flat, whatever is in texts, numbers and comments.
TEST(Nesting, FlatTextsAreNotRefused) {
  EXPECT_FALSE(LineNestedTooDeep(NestedFormat::kJson,
                                 "[" + Repeated(R"({"a": [1.5, "[[[[{{{{", []]}, )", 1000) + "1]"));
  EXPECT_FALSE(LineNestedTooDeep(
      NestedFormat::kToml, "x = \"" + Repeated("[.", 1000) + "\"\ny = '''" + Repeated("[\n", 1000) +
                               "'''\n# " + Repeated("[.", 1000) + "\nz = [" +
                               Repeated("1.5, ", 1000) + "]\nw = [\n" +
                               Repeated("  [1.5, 2.5],\n", 1000) + "]\n" +
                               Repeated("[[camera]]\nsource = 'a.b'\n", 1000)));
  EXPECT_FALSE(LineNestedTooDeep(
      NestedFormat::kYaml, Repeated("cam0:\n  T: \n  - [1.0, -2.0]\n  - [3, 4]\n  name: \"a\"\n"
                                    "  - -1\n  url: http://a:b\n",
                                    1000)));
  EXPECT_FALSE(LineNestedTooDeep(
      NestedFormat::kXml,
      "<?xml?><a>" + Repeated("<b c='<'/><d>text</d><e f=\"1\" /><!-- <g> -->", 1000) + "</a>"));
}

TEST(Nesting, AnyBytesAreRead) {
  using enum NestedFormat;
  for (const NestedFormat format : {kJson, kToml, kYaml, kXml}) {
    for (const std::string& text :
         {std::string(), std::string("\""), std::string("'''"), std::string("\"\\"),
          std::string("<!--"), std::string("<"), std::string("[\0]", 3), std::string("]]]]"),
          std::string("- "), std::string("-"), std::string("\xff\xfe[[")}) {
      EXPECT_FALSE(LineNestedTooDeep(format, text)) << text;
    }
  }
}

}  // namespace
}  // namespace rigcal::testing::nesting_test
