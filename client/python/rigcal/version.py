# SPDX-License-Identifier: Apache-2.0
"""The release of this package, which is that of the programs it was built with."""

VERSION = "0.1.0"
