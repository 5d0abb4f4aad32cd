// SPDX-License-Identifier: Apache-2.0
#include "tests/architecture/include_rules.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>

namespace rigcal::testing::include_rules_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
namespace fs = std::filesystem;

TEST(IncludeRules, HoldInTheWholeTree) {
  int files = 0;
  for (const char* layer : {"common", "agent", "server", "client"}) {
    for (const auto& entry :
         fs::recursive_directory_iterator(fs::path(RIGCAL_SOURCE_DIR) / layer)) {
      const std::string extension = entry.path().extension();
      if (extension != ".h" && extension != ".cc") continue;
      ++files;
      const std::string file = fs::relative(entry.path(), RIGCAL_SOURCE_DIR);
      std::ifstream stream(entry.path());
      const std::string text{std::istreambuf_iterator<char>(stream), {}};
      for (const std::string& include : IncludesOf(text)) {
        EXPECT_THAT(ForbiddenBecause(file, include), IsEmpty()) << file << " includes " << include;
      }
    }
  }
  EXPECT_GT(files, 50) << "the tree was not found";
}

TEST(IncludeRules, EachFolderHasOneLayer) {
  std::set<std::string> seen;
  for (const Layer& layer : Layers()) {
    for (const std::string& folder : layer.folders) {
      EXPECT_TRUE(seen.insert(folder).second) << folder << " is in two layers";
      EXPECT_TRUE(fs::exists(fs::path(RIGCAL_SOURCE_DIR) / folder)) << folder;
    }
  }
  for (const Island& island : Islands()) {
    for (const std::string& folder : island.folders) {
      EXPECT_TRUE(fs::exists(fs::path(RIGCAL_SOURCE_DIR) / folder)) << folder;
    }
  }
}

TEST(IncludeRules, ProgramsDoNotKnowEachOther) {
  EXPECT_THAT(ForbiddenBecause("agent/uplink/uplink.cc", "server/store/store.h"),
              HasSubstr("agent never includes server"));
  EXPECT_THAT(ForbiddenBecause("client/main.cc", "agent/capture/observation_source.h"),
              HasSubstr("client never includes agent"));
  EXPECT_THAT(ForbiddenBecause("common/wire/camera_wire.cc", "server/store/store.h"),
              HasSubstr("common never includes server"));
}

TEST(IncludeRules, InnerLayersStayInside) {
  EXPECT_THAT(ForbiddenBecause("server/solve/calibrate.cc", "common/wire/camera_wire.h"),
              HasSubstr("may not include common/wire"));
  EXPECT_THAT(ForbiddenBecause("server/solve/calibrate.cc", "rigcal/v1/camera.pb.h"),
              HasSubstr("may not see gRPC"));
  EXPECT_THAT(ForbiddenBecause("server/solve/calibrate.cc", "fstream"), HasSubstr("no files"));
  EXPECT_THAT(ForbiddenBecause("agent/capture/x.cc", "grpcpp/grpcpp.h"), HasSubstr("gRPC"));
  EXPECT_THAT(ForbiddenBecause("server/ingest/x.cc", "SQLiteCpp/SQLiteCpp.h"), HasSubstr("SQL"));
  EXPECT_THAT(ForbiddenBecause("server/elsewhere/x.cc", "common/status/refusal.h"),
              HasSubstr("no layer yet"));
}

TEST(IncludeRules, NobodyIncludesWhatIsAboveOrBeside) {
  EXPECT_THAT(ForbiddenBecause("common/status/x.cc", "common/wire/camera_wire.h"),
              HasSubstr("knows no messages"));
  EXPECT_THAT(ForbiddenBecause("common/status/x.cc", "common/target/target.h"),
              HasSubstr("not below it"));
  EXPECT_THAT(ForbiddenBecause("server/session/x.cc", "server/worker/worker.h"),
              HasSubstr("not below it"));
  EXPECT_THAT(ForbiddenBecause("server/solve/rig/x.cc", "server/store/store.h"),
              HasSubstr("a solve can run elsewhere"));
  EXPECT_THAT(ForbiddenBecause("agent/detect/frame/x.cc", "agent/spool/observation_spool.h"),
              HasSubstr("known to no camera"));
}

TEST(IncludeRules, AllowWhatIsMeant) {
  EXPECT_THAT(ForbiddenBecause("server/main.cc", "server/store/sqlite/sqlite_store.h"), IsEmpty());
  EXPECT_THAT(ForbiddenBecause("server/solve/calibrate.cc", "server/associate/associate.h"),
              IsEmpty());
  EXPECT_THAT(ForbiddenBecause("common/wire/camera_wire.cc", "rigcal/v1/camera.pb.h"), IsEmpty());
  EXPECT_THAT(ForbiddenBecause("server/solve/calibrate.cc", "vector"), IsEmpty());
}

TEST(IncludeRules, FindsEveryInclude) {
  EXPECT_THAT(
      IncludesOf("#include <vector>\n  # include \"a/b.h\"\n// #include-like text\nint x;\n"),
      ElementsAre("vector", "a/b.h"));
}

// No file whose name says nothing, no SPDX line missing.
TEST(SourceTree, EveryFileSaysWhatItIs) {
  const std::set<std::string> empty_names = {"utils",   "util", "helpers", "helper",
                                             "manager", "misc", "common"};
  for (const char* layer : {"common", "agent", "server", "client", "tests", "proto"}) {
    for (const auto& entry :
         fs::recursive_directory_iterator(fs::path(RIGCAL_SOURCE_DIR) / layer)) {
      const std::string extension = entry.path().extension();
      if (extension != ".h" && extension != ".cc" && extension != ".proto") continue;
      EXPECT_FALSE(empty_names.contains(entry.path().stem())) << entry.path();
      std::ifstream stream(entry.path());
      std::string first_line;
      std::getline(stream, first_line);
      EXPECT_EQ(first_line, "// SPDX-License-Identifier: Apache-2.0") << entry.path();
    }
  }
}

}  // namespace
}  // namespace rigcal::testing::include_rules_test
