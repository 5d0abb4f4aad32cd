// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace rigcal::server {

// Raises this process's limit of open descriptors as far as it may; returns the limit.
size_t RaiseDescriptorLimit();

// How many connections may be open at a time, two descriptors each, beside what else the server
// opens: at most `wanted`.
size_t ConnectionsWithin(size_t descriptor_limit, size_t wanted);

}  // namespace rigcal::server
