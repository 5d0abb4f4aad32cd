// SPDX-License-Identifier: Apache-2.0
#include "client/commands/list_options.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace rigcal::client {

std::string FilterOf(const ListOptions& options) {
  std::vector<std::string> terms;
  if (!options.rig.empty()) terms.push_back(absl::StrCat("rig=\"", options.rig, "\""));
  if (!options.session.empty()) {
    terms.push_back(absl::StrCat("session_ids:\"", options.session, "\""));
  }
  if (!options.filter.empty()) terms.push_back(options.filter);
  return absl::StrJoin(terms, " AND ");
}

}  // namespace rigcal::client
