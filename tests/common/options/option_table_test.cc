// SPDX-License-Identifier: Apache-2.0
#include "common/options/option_table.h"

#include <limits>
#include <optional>
#include <string>

#include "common/options/nearest_name.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::option_table_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

enum class Colour { kRed, kGreen };

struct Wheel {
  double radius_m = 0.3;
  std::optional<double> width_m;
  int spokes = 32;
  bool tube = true;
  Colour colour = Colour::kRed;
  std::optional<Colour> rim;
  std::string maker;
  std::string drawing;
  std::vector<double> gears = {1, 2};
  std::map<int, double> wear;
};

void AddOptions(Wheel* wheel, OptionTable* table) {
  table->Add("radius", &wheel->radius_m, {kAboveZero, 2, "m"}, "of the rim");
  table->Add("width", &wheel->width_m, {0.01, 0.2, "m"}, "of the tyre");
  table->Add("spokes", &wheel->spokes, {0, 64}, "how many");
  table->Add("tube", &wheel->tube, "whether there is one");
  const std::vector<std::pair<std::string, Colour>> colours = {{"red", Colour::kRed},
                                                               {"green", Colour::kGreen}};
  table->AddChoice("colour", &wheel->colour, colours, "of the frame");
  table->AddChoice("rim", &wheel->rim, colours, "of the rim");
  table->Add("maker", &wheel->maker, "NAME", "who made it");
  table->AddPath("drawing", &wheel->drawing, "of the wheel");
  table->Add("gears", &wheel->gears, {kAboveZero, kNoLimit}, "ratios");
  table->Add("wear", &wheel->wear, {0, 1}, "of spoke N");
}

class OptionTableTest : public ::testing::Test {
 protected:
  OptionTableTest() { AddOptions(&wheel_, &table_); }
  absl::Status Read(const std::string& text) {
    FaultList faults;
    const auto given = SplitOptionList(text);
    faults.Add(given.status());
    if (given.ok()) table_.Read(*given, &faults);
    return faults.Result();
  }
  Wheel wheel_;
  OptionTable table_;
};

TEST_F(OptionTableTest, SetsWhatIsGiven) {
  EXPECT_THAT(Read("radius=0.5;width=0.1; spokes=36 ;tube=false;colour=green;rim=red;maker=a b;"
                   "drawing=d.pdf;gears=1, 1.5,3;wear.3=0.5;;"),
              IsOk());
  EXPECT_EQ(wheel_.radius_m, 0.5);
  EXPECT_EQ(wheel_.width_m, 0.1);
  EXPECT_EQ(wheel_.spokes, 36);
  EXPECT_FALSE(wheel_.tube);
  EXPECT_EQ(wheel_.colour, Colour::kGreen);
  EXPECT_EQ(wheel_.rim, Colour::kRed);
  EXPECT_EQ(wheel_.maker, "a b");
  EXPECT_EQ(wheel_.drawing, "d.pdf");
  EXPECT_THAT(wheel_.gears, ElementsAre(1, 1.5, 3));
  EXPECT_EQ(wheel_.wear.at(3), 0.5);
}

TEST_F(OptionTableTest, NamesEveryFault) {
  EXPECT_THAT(Read("radius=0;width=wide;spokes=1.5;tube=maybe;colour=blue;gears=1,x;wear.x=1;"
                   "wear.1=2;raduis=1;fog=1"),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       AllOf(HasSubstr("radius=0 must be a number above 0, at most 2 m"),
                             HasSubstr("width=wide must be a number of 0.01 to 0.2 m"),
                             HasSubstr("spokes=1.5 must be a whole number of 0 to 64"),
                             HasSubstr("tube=maybe must be 0 or 1"),
                             HasSubstr("colour=blue must be red or green"),
                             HasSubstr("gears=1,x must be a number above 0"),
                             HasSubstr("wear.x=1 must name a camera by its index"),
                             HasSubstr("wear.1=2 must be a number of 0 to 1"),
                             HasSubstr("unknown option \"raduis\"; did you mean \"radius\"?"),
                             HasSubstr("unknown option \"fog\"; known: radius, width"))));
  EXPECT_THAT(
      Read("radius;=1;radius=1;maker="),
      StatusIs(
          absl::StatusCode::kInvalidArgument,
          AllOf(HasSubstr("\"radius\" is not KEY=VALUE"), HasSubstr("\"=1\" is not KEY=VALUE"),
                HasSubstr("radius is given twice"), HasSubstr("\"maker=\" is not KEY=VALUE"))));
}

TEST_F(OptionTableTest, LeavesAValueAloneThatIsWrong) {
  EXPECT_THAT(Read("radius=nan;spokes=65;gears=2,-1"), Not(IsOk()));
  EXPECT_EQ(wheel_.radius_m, 0.3);
  EXPECT_EQ(wheel_.spokes, 32);
  EXPECT_THAT(wheel_.gears, ElementsAre(1, 2));
}

TEST_F(OptionTableTest, KnowsTheTypesOfAConfigurationFile) {
  using Type = OptionText::Type;
  const auto read = [&](OptionText option) {
    option.where = "wheel.toml:7";
    FaultList faults;
    table_.ReadOne(option, &faults);
    return faults.Result();
  };
  EXPECT_THAT(read({.key = "radius", .value = "1", .type = Type::kNumber}), IsOk());
  EXPECT_THAT(read({.key = "radius", .value = "1", .type = Type::kText}),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       HasSubstr("wheel.toml:7: radius=1 must be a number")));
  EXPECT_THAT(read({.key = "maker", .value = "1", .type = Type::kNumber}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("must be text in quotes")));
  EXPECT_THAT(read({.key = "tube", .value = "1", .type = Type::kNumber}),
              StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("must be true or false")));
}

TEST_F(OptionTableTest, SetsAllOptionsOfOneName) {
  Wheel other;
  AddOptions(&other, &table_);
  EXPECT_THAT(Read("spokes=20"), IsOk());
  EXPECT_EQ(wheel_.spokes, 20);
  EXPECT_EQ(other.spokes, 20);
  EXPECT_EQ(table_.Names().size(), 10u);
}

TEST_F(OptionTableTest, HelpTellsValuesDefaultsAndMeaning) {
  const std::vector<OptionHelp> help = table_.Help();
  ASSERT_EQ(help.size(), 10u);
  EXPECT_EQ(help[0].name, "radius");
  EXPECT_EQ(help[0].values, "above 0, at most 2 m");
  EXPECT_EQ(help[0].default_value, "0.3");
  EXPECT_EQ(help[0].meaning, "of the rim");
  EXPECT_EQ(help[1].default_value, "");
  EXPECT_EQ(help[4].values, "red|green");
  EXPECT_EQ(help[9].name, "wear.N");
  EXPECT_TRUE(table_.IsPath("drawing"));
  EXPECT_FALSE(table_.IsPath("maker"));
}

TEST(FormatOptions, IsReadBack) {
  Wheel wheel;
  EXPECT_EQ(FormatOptions(wheel), "");
  EXPECT_EQ(FormatOptions(wheel, {"spokes"}), "spokes=32");
  wheel.radius_m = 1.0 / 3;
  wheel.tube = false;
  wheel.wear = {{2, 0.1}, {5, 1}};
  EXPECT_EQ(FormatOptions(wheel), "radius=0.3333333333333333;tube=0;wear.2=0.1;wear.5=1");
}

TEST(CheckOptions, NamesEveryValueThatIsWrong) {
  Wheel wheel;
  FaultList none;
  CheckOptions(wheel, &none);
  EXPECT_THAT(none.Result(), IsOk());
  wheel.radius_m = std::numeric_limits<double>::quiet_NaN();
  wheel.spokes = -1;
  wheel.wear[1] = 3;
  FaultList faults;
  CheckOptions(wheel, &faults);
  EXPECT_THAT(faults.Result(), StatusIs(absl::StatusCode::kInvalidArgument,
                                        AllOf(HasSubstr("radius=nan"), HasSubstr("spokes=-1"),
                                              HasSubstr("wear.1=3"))));
}

TEST(NearestName, FindsTypingErrorsOnly) {
  const std::vector<std::string> known = {"fps", "exposure", "hue_min", "hue_max"};
  EXPECT_EQ(NearestName("fpss", known), "fps");
  EXPECT_EQ(NearestName("pfs", known), "fps");
  EXPECT_EQ(NearestName("exposrue", known), "exposure");
  EXPECT_EQ(NearestName("hue_mn", known), "hue_min");
  EXPECT_EQ(NearestName("gain", known), "");
  EXPECT_EQ(NearestName("", known), "");
  EXPECT_EQ(NearestName(std::string(1000, 'x'), known), "");
}

TEST(UnknownName, ShowsHostileTextShortAndPrintable) {
  const std::string text = UnknownName("option", std::string(1000, '\n'), {"fps"});
  EXPECT_LT(text.size(), 500u);
  EXPECT_EQ(text.find('\n'), text.npos);
}

}  // namespace
}  // namespace rigcal::option_table_test
