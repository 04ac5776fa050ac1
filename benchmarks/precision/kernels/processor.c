/* What the processor has; compiled without any of it. */
int has_avx512(void) {
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512vl");
}
int has_avx512_bf16(void) { return has_avx512() && __builtin_cpu_supports("avx512bf16"); }
int has_avx512_vnni(void) { return has_avx512() && __builtin_cpu_supports("avx512vnni"); }
