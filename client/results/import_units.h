// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "common/import/imported_rig.h"

namespace rigcal::client {

// m, cm, mm, in, ft: what --units of an import takes.
std::vector<std::string> LengthUnitNames();

// Makes metres of a rig whose file has its lengths in `units`. Without units nothing changes, and
// the doubt is returned where the lengths cannot be metres: which unit fits, and how to say it.
std::string ApplyUnits(const std::string& path, const std::string& units, ImportedRig* rig);

}  // namespace rigcal::client
