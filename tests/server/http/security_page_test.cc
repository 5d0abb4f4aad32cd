// SPDX-License-Identifier: Apache-2.0
// docs/security.md says who may call what: as the server decides.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "absl/strings/string_view.h"
#include "server/access/access_rules.h"
#include "server/api/api_routes.h"

namespace rigcal::testing::security_page_test {
namespace {

using ::testing::IsEmpty;
using ::testing::UnorderedElementsAreArray;

struct PageRow {
  std::set<std::string> routes;
  std::set<std::string> roles;
};

// By the call's name: "SessionService.StopSession".
std::map<std::string, PageRow> ReadPage() {
  std::ifstream file(RIGCAL_SOURCE_DIR "/docs/security.md");
  std::map<std::string, PageRow> rows;
  std::vector<std::string> roles;  // of the columns of the table that is read
  for (std::string line; std::getline(file, line);) {
    std::vector<std::string> cells = absl::StrSplit(line, '|');
    for (std::string& cell : cells) absl::StripAsciiWhitespace(&cell);
    if (line.starts_with("| call |")) {
      roles = {cells.begin() + 3, cells.end() - 1};
    } else if (!line.starts_with("|")) {
      roles.clear();
    } else if (!roles.empty() && cells.size() == roles.size() + 4 && cells[1].starts_with('`')) {
      PageRow& row = rows[absl::StrReplaceAll(cells[1], {{"`", ""}})];
      for (size_t i = 0; i < roles.size(); ++i) {
        if (cells[i + 3] == "yes") row.roles.insert(roles[i]);
      }
      const std::string routes = absl::StrReplaceAll(cells[2], {{"`", ""}});
      for (const absl::string_view route : absl::StrSplit(routes, ", ")) {
        if (route != "-") row.routes.insert(std::string(route));
      }
    }
  }
  return rows;
}

TEST(SecurityPage, SaysWhoMayCallWhat) {
  std::map<std::string, PageRow> page = ReadPage();
  for (const server::AccessRule& rule : server::AccessRules()) {
    const std::string name =
        absl::StrReplaceAll(std::string(rule.method.substr(1)), {{"rigcal.v1.", ""}, {"/", "."}});
    ASSERT_TRUE(page.contains(name)) << name << " is not in docs/security.md";
    std::set<std::string> roles;
    for (const Role role : kRoles) {
      if (rule.roles.contains(role)) roles.insert(std::string(RoleName(role)));
    }
    EXPECT_THAT(page[name].roles, UnorderedElementsAreArray(roles)) << name;
    std::set<std::string> routes;
    for (const server::ApiRoute& route : server::ApiRoutes()) {
      if (route.rpc == rule.method) {
        routes.insert(absl::StrCat(std::string(route.method), " ", std::string(route.path)));
      }
    }
    EXPECT_THAT(page[name].routes, UnorderedElementsAreArray(routes)) << name;
    page.erase(name);
  }
  EXPECT_THAT(page, IsEmpty()) << page.begin()->first << " does not exist";
}

}  // namespace
}  // namespace rigcal::testing::security_page_test
