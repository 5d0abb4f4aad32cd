// SPDX-License-Identifier: Apache-2.0
#include "client/results/parquet_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/str_cat.h"
#include "tests/client/results/parquet_reader.h"
#include "tests/testing/process.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::client::parquet_file_test {
namespace {

using ::rigcal::testing::CommandResult;
using ::rigcal::testing::ParquetTable;
using ::rigcal::testing::ReadParquet;
using ::rigcal::testing::RunCommand;
using ::rigcal::testing::TemporaryDirectory;
using ::testing::ElementsAre;

struct Samples {
  std::vector<int64_t> times_ns;
  std::vector<double> lengths_m;
  std::vector<std::string> labels;
  std::vector<int32_t> counts;

  std::vector<ParquetColumn> Columns() const {
    return {{"time_ns", times_ns}, {"x_m", lengths_m}, {"label", labels}, {"cameras", counts}};
  }
};

Samples MakeSamples(int count) {
  Samples samples;
  for (int i = 0; i < count; ++i) {
    samples.times_ns.push_back(1'700'000'000'000'000'000 + int64_t{40'000'001} * i);
    samples.lengths_m.push_back(0.1 * i - 3);
    samples.labels.push_back(i % 3 == 0 ? "" : absl::StrCat("Spitze \xc3\xa4", i));
    samples.counts.push_back(-i);
  }
  return samples;
}

TEST(ParquetFile, ReadsBackByTheFormatsDocumentation) {
  Samples samples = MakeSamples(1000);
  samples.times_ns[0] = std::numeric_limits<int64_t>::min();
  samples.counts[0] = std::numeric_limits<int32_t>::min();
  samples.lengths_m[0] = std::numeric_limits<double>::infinity();
  const ParquetTable table =
      ReadParquet(ParquetFile(samples.Columns(), {{"frame", "rig"}, {"empty", ""}}, 300));
  EXPECT_THAT(table.names, ElementsAre("time_ns", "x_m", "label", "cameras"));
  EXPECT_EQ(table.row_count, 1000);
  EXPECT_THAT(table.group_rows, ElementsAre(300, 300, 300, 100));
  EXPECT_EQ(std::get<std::vector<int64_t>>(table.columns[0]), samples.times_ns);
  EXPECT_EQ(std::get<std::vector<double>>(table.columns[1]), samples.lengths_m);
  EXPECT_EQ(std::get<std::vector<std::string>>(table.columns[2]), samples.labels);
  EXPECT_EQ(std::get<std::vector<int32_t>>(table.columns[3]), samples.counts);
  EXPECT_THAT(table.notes, ElementsAre(std::pair("empty", ""), std::pair("frame", "rig")));
}

TEST(ParquetFile, HoldsTablesWithoutRowsAndOfManyColumns) {
  std::vector<ParquetColumn> columns;
  for (int c = 0; c < 40; ++c) {
    columns.push_back({absl::StrCat("column_", c), std::vector<double>()});
  }
  const ParquetTable empty = ReadParquet(ParquetFile(columns, {}));
  EXPECT_EQ(empty.row_count, 0);
  EXPECT_EQ(empty.names.size(), 40u);
  for (ParquetColumn& column : columns) column.values = std::vector<double>{1, 2};
  const ParquetTable two = ReadParquet(ParquetFile(columns, {}, 1));
  EXPECT_THAT(two.group_rows, ElementsAre(1, 1));
  EXPECT_THAT(std::get<std::vector<double>>(two.columns[39]), ElementsAre(1, 2));
}

// A reader that is not ours; tests/run.sh installs it.
TEST(ParquetFile, ReadsBackByHyparquet) {
  const std::filesystem::path package =
      std::filesystem::path(RIGCAL_SOURCE_DIR) / "build/npm/node_modules/hyparquet";
  if (!std::filesystem::exists(package)) {
    GTEST_SKIP() << "hyparquet is not installed; tests/run.sh installs it by npm where there is a "
                    "network";
  }
  const Samples samples = MakeSamples(1000);
  const TemporaryDirectory folder;
  std::ofstream(folder.path() / "points.parquet", std::ios::binary)
      << ParquetFile(samples.Columns(), {{"frame", "rig"}}, 300);
  const std::string script = absl::StrCat(
      "import { parquetReadObjects, parquetMetadata } from '", package.string(),
      "/src/index.js';\n",
      "import { readFileSync } from 'node:fs';\n"
      "const bytes = new Uint8Array(readFileSync(process.argv[2])).buffer;\n"
      "const file = { byteLength: bytes.byteLength, slice: (a, b) => bytes.slice(a, b) };\n"
      "const rows = await parquetReadObjects({ file });\n"
      "const notes = parquetMetadata(bytes).key_value_metadata;\n"
      "const text = (key, value) => typeof value === 'bigint' ? String(value) : value;\n"
      "console.log(JSON.stringify({ rows, notes }, text));\n");
  const std::filesystem::path file = folder.WriteFile("read.mjs", script);
  const CommandResult result = RunCommand(
      {"/bin/sh", "-c",
       absl::StrCat("node ", file.string(), " ", (folder.path() / "points.parquet").string())});
  ASSERT_EQ(result.exit_code, 0) << result.error;
  const auto json = nlohmann::json::parse(result.output);
  ASSERT_EQ(json.at("rows").size(), 1000u);
  for (size_t i = 0; i < 1000; ++i) {
    const auto& row = json.at("rows")[i];
    EXPECT_EQ(row.at("time_ns"), absl::StrCat(samples.times_ns[i]));
    EXPECT_EQ(row.at("x_m").get<double>(), samples.lengths_m[i]);
    EXPECT_EQ(row.at("label"), samples.labels[i]);
    EXPECT_EQ(row.at("cameras"), samples.counts[i]);
  }
  EXPECT_EQ(json.at("notes")[0].at("key"), "frame");
  EXPECT_EQ(json.at("notes")[0].at("value"), "rig");
}

}  // namespace
}  // namespace rigcal::client::parquet_file_test
