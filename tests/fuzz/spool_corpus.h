// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace rigcal::agent {

// Writes the seeds of spool_segment and spool_checkpoint into folders of `corpus`. False: a file
// cannot be written.
bool SaveSpool(const std::filesystem::path& corpus);

}  // namespace rigcal::agent
