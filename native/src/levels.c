#include "level.h"

extern const grouser_level grouser_level_portable;
#if GROUSER_X86_LEVELS
extern const grouser_level grouser_level_v3, grouser_level_v4;
#endif

int grouser_levels(const grouser_level *levels[GROUSER_LEVELS]) {
  int count = 0;
#if GROUSER_X86_LEVELS
  __builtin_cpu_init();
  const int v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (v3 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl"))
    levels[count++] = &grouser_level_v4;
  if (v3) levels[count++] = &grouser_level_v3;
#endif
  levels[count++] = &grouser_level_portable;
  return count;
}
