#if (defined(__unix__) || defined(__APPLE__)) && !defined(_POSIX_C_SOURCE)
#define _POSIX_C_SOURCE 200809L
#endif

#include "threads.h"

/* As many as a crew of a fleet has; see fleet_lanes.c. */
enum { BLOCKS_A_PART = 8 };

static void run_alone(grouser_share share, int parts, void *work) {
  for (int part = 0; part < parts; part++) share(work, part, parts);
}

int grouser_pool_parts(const grouser_pool *pool, int blocks) {
  if (!pool || pool->threads == 1) return 1;
  const int crews = (blocks + BLOCKS_A_PART - 1) / BLOCKS_A_PART;
  const int parts = crews > pool->threads ? crews : pool->threads;
  return parts < blocks ? parts : blocks;
}

#if GROUSER_PTHREADS

#include <unistd.h>

/* The C libraries differ widely in what a thread gets by default; a kernel's scratch takes some 100 kB. */
enum { STACK_SIZE = 1 << 21 };

/* Takes shares until there are none left to take; called and left with the lock held. */
static void take_shares(grouser_pool *pool) {
  while (pool->next < pool->parts) {
    const grouser_share share = pool->share;
    void *work = pool->work;
    const int part = pool->next++, parts = pool->parts;
    pthread_mutex_unlock(&pool->lock);
    share(work, part, parts);
    pthread_mutex_lock(&pool->lock);
    if (--pool->unfinished == 0) pthread_cond_signal(&pool->finished);
  }
}

static void *serve(void *pool_pointer) {
  grouser_pool *pool = (grouser_pool *)pool_pointer;
  pthread_mutex_lock(&pool->lock);
  while (!pool->stopping) {
    take_shares(pool);
    if (!pool->stopping) pthread_cond_wait(&pool->called, &pool->lock);
  }
  pthread_mutex_unlock(&pool->lock);
  return 0;
}

int grouser_pool_start(grouser_pool *pool, int threads) {
  pthread_attr_t attributes;
  pool->threads = 1;
  pool->parts = pool->next = pool->unfinished = pool->stopping = 0;
  pool->process = getpid();
  if (pthread_mutex_init(&pool->lock, 0) != 0) return 0;
  pthread_cond_init(&pool->called, 0);
  pthread_cond_init(&pool->finished, 0);
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, STACK_SIZE);
  while (pool->threads < threads) {
    if (pthread_create(&pool->workers[pool->threads], &attributes, serve, pool) != 0) break;
    pool->threads++;
  }
  pthread_attr_destroy(&attributes);
  if (pool->threads == threads) return 1;
  grouser_pool_stop(pool);
  return 0;
}

void grouser_pool_run(grouser_pool *pool, grouser_share share, int parts, void *work) {
  if (parts == 1 || pool->threads == 1 || pool->process != getpid()) {
    run_alone(share, parts, work);
    return;
  }
  pthread_mutex_lock(&pool->lock);
  pool->share = share;
  pool->work = work;
  pool->parts = pool->unfinished = parts;
  pool->next = 0;
  pthread_cond_broadcast(&pool->called);
  take_shares(pool);
  while (pool->unfinished > 0) pthread_cond_wait(&pool->finished, &pool->lock);
  pthread_mutex_unlock(&pool->lock);
}

void grouser_pool_stop(grouser_pool *pool) {
  /* Threads do not follow their process through a fork: the child has none to join. */
  if (pool->process != getpid()) return;
  pthread_mutex_lock(&pool->lock);
  pool->stopping = 1;
  pthread_cond_broadcast(&pool->called);
  pthread_mutex_unlock(&pool->lock);
  for (int part = 1; part < pool->threads; part++) pthread_join(pool->workers[part], 0);
  pthread_cond_destroy(&pool->finished);
  pthread_cond_destroy(&pool->called);
  pthread_mutex_destroy(&pool->lock);
}

#else

int grouser_pool_start(grouser_pool *pool, int threads) {
  pool->threads = threads;
  return 1;
}

void grouser_pool_run(grouser_pool *pool, grouser_share share, int parts, void *work) {
  (void)pool;
  run_alone(share, parts, work);
}

void grouser_pool_stop(grouser_pool *pool) { (void)pool; }

#endif
