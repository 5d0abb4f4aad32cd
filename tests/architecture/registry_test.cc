// SPDX-License-Identifier: Apache-2.0
// Each reason of refusal, kind of finding and stage has exactly one row in the documents.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <vector>

#include "common/calibration/calibration_stage.h"
#include "common/calibration/finding_kind.h"
#include "common/status/refusal.h"
#include "rigcal/v1/calibration.pb.h"
#include "rigcal/v1/finding.pb.h"
#include "rigcal/v1/refusal.pb.h"

namespace rigcal::testing::registry_test {
namespace {

using ::testing::UnorderedElementsAreArray;

// First cells of the rows of the table whose head begins with `head`, without backquotes.
std::vector<std::string> RowsOf(const std::string& document, const std::string& head) {
  std::ifstream stream(std::filesystem::path(RIGCAL_SOURCE_DIR) / "docs" / document);
  std::vector<std::string> rows;
  bool inside = false;
  const std::regex first_cell(R"(^\| `?([a-z_0-9]+)`? \|)");
  for (std::string line; std::getline(stream, line);) {
    if (line.rfind("| " + head + " |", 0) == 0) {
      inside = true;
    } else if (line.empty() || line[0] != '|') {
      inside = false;
    }
    std::smatch match;
    if (inside && line.rfind("| " + head, 0) != 0 && line.rfind("|---", 0) != 0) {
      EXPECT_TRUE(std::regex_search(line, match, first_cell)) << document << ": " << line;
      if (!match.empty()) rows.push_back(match[1]);
    }
  }
  EXPECT_FALSE(rows.empty()) << document << " has no table " << head;
  return rows;
}

// The names of an enum's values as the documents have them; zero is never one of them.
std::vector<std::string> NamesOf(const google::protobuf::EnumDescriptor* descriptor,
                                 const std::string& prefix) {
  std::vector<std::string> names;
  for (int i = 0; i < descriptor->value_count(); ++i) {
    const google::protobuf::EnumValueDescriptor* value = descriptor->value(i);
    EXPECT_EQ(value->name().rfind(prefix, 0), 0u) << value->name();
    std::string name = value->name().substr(prefix.size());
    for (char& c : name) c = static_cast<char>(std::tolower(c));
    if (value->number() == 0) {
      EXPECT_EQ(name, "unspecified");
    } else {
      names.push_back(name);
    }
  }
  return names;
}

// The C++ enum has the numbers and names of the proto's.
template <typename Table>
void ExpectSameNumbers(const Table& table, const google::protobuf::EnumDescriptor* descriptor,
                       const std::string& prefix) {
  EXPECT_EQ(std::size(table), static_cast<size_t>(descriptor->value_count()) - 1);
  for (const auto& [value, name] : table) {
    const auto* proto = descriptor->FindValueByNumber(static_cast<int>(value));
    ASSERT_NE(proto, nullptr) << name;
    std::string upper(name);
    for (char& c : upper) c = static_cast<char>(std::toupper(c));
    EXPECT_EQ(proto->name(), prefix + upper);
    EXPECT_EQ(NameOf(value), name);
  }
}

TEST(Registry, EveryReasonOfRefusalIsExplained) {
  const auto* reasons = v1::RefusalReason_descriptor();
  EXPECT_THAT(RowsOf("refusals.md", "reason"),
              UnorderedElementsAreArray(NamesOf(reasons, "REFUSAL_REASON_")));
  ExpectSameNumbers(kRefusalReasonNames, reasons, "REFUSAL_REASON_");
  for (const auto& [reason, name] : kRefusalReasonNames) {
    EXPECT_EQ(RefusalReasonFromName(name), reason);
  }
  EXPECT_EQ(RefusalReasonFromName("nonsense"), RefusalReason::kUnspecified);
  EXPECT_EQ(NameOf(static_cast<RefusalReason>(250)), "unspecified");
}

TEST(Registry, EveryKindOfFindingIsExplained) {
  const auto* kinds = v1::FindingKind_descriptor();
  EXPECT_THAT(RowsOf("findings.md", "kind"),
              UnorderedElementsAreArray(NamesOf(kinds, "FINDING_KIND_")));
  ExpectSameNumbers(kFindingKindNames, kinds, "FINDING_KIND_");
}

TEST(Registry, EveryStageIsExplained) {
  const auto* stages = v1::CalibrationStage_descriptor();
  EXPECT_THAT(RowsOf("api.md", "stage"),
              UnorderedElementsAreArray(NamesOf(stages, "CALIBRATION_STAGE_")));
  ExpectSameNumbers(kCalibrationStageNames, stages, "CALIBRATION_STAGE_");
}

}  // namespace
}  // namespace rigcal::testing::registry_test
