#include "threads.h"  // SPDX-License-Identifier: Apache-2.0
