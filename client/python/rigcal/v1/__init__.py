# SPDX-License-Identifier: Apache-2.0
"""The messages of the API (proto/rigcal/v1), made by protoc when rigcal is built."""
