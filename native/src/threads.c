#if (defined(__unix__) || defined(__APPLE__)) && !defined(_POSIX_C_SOURCE)
#define _POSIX_C_SOURCE 200809L
#endif

#include "threads.h"

static void run_alone(const grouser_pool *pool, grouser_share share, void *work) {
  for (int part = 0; part < pool->threads; part++) share(work, part, pool->threads);
}

#if GROUSER_PTHREADS

#include <unistd.h>

/* The C libraries differ widely in what a thread gets by default; a kernel's scratch takes some 100 kB. */
enum { STACK_SIZE = 1 << 21 };

static void *serve(void *seat_pointer) {
  const grouser_seat *seat = (const grouser_seat *)seat_pointer;
  grouser_pool *pool = seat->pool;
  int round = 0;
  pthread_mutex_lock(&pool->lock);
  for (;;) {
    while (pool->round == round && !pool->stopping) pthread_cond_wait(&pool->called, &pool->lock);
    if (pool->stopping) break;
    round = pool->round;
    const grouser_share share = pool->share;
    void *work = pool->work;
    pthread_mutex_unlock(&pool->lock);
    share(work, seat->part, pool->threads);
    pthread_mutex_lock(&pool->lock);
    if (--pool->busy == 0) pthread_cond_signal(&pool->finished);
  }
  pthread_mutex_unlock(&pool->lock);
  return 0;
}

int grouser_pool_start(grouser_pool *pool, int threads) {
  pthread_attr_t attributes;
  pool->threads = 1;
  pool->round = pool->busy = pool->stopping = 0;
  pool->process = getpid();
  if (pthread_mutex_init(&pool->lock, 0) != 0) return 0;
  pthread_cond_init(&pool->called, 0);
  pthread_cond_init(&pool->finished, 0);
  pthread_attr_init(&attributes);
  pthread_attr_setstacksize(&attributes, STACK_SIZE);
  while (pool->threads < threads) {
    const int part = pool->threads;
    pool->seats[part].pool = pool;
    pool->seats[part].part = part;
    if (pthread_create(&pool->workers[part], &attributes, serve, &pool->seats[part]) != 0) break;
    pool->threads++;
  }
  pthread_attr_destroy(&attributes);
  if (pool->threads == threads) return 1;
  grouser_pool_stop(pool);
  return 0;
}

void grouser_pool_run(grouser_pool *pool, grouser_share share, void *work) {
  if (pool->threads == 1 || pool->process != getpid()) {
    run_alone(pool, share, work);
    return;
  }
  pthread_mutex_lock(&pool->lock);
  pool->share = share;
  pool->work = work;
  pool->busy = pool->threads - 1;
  pool->round = !pool->round;
  pthread_cond_broadcast(&pool->called);
  pthread_mutex_unlock(&pool->lock);
  share(work, 0, pool->threads);
  pthread_mutex_lock(&pool->lock);
  while (pool->busy > 0) pthread_cond_wait(&pool->finished, &pool->lock);
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

void grouser_pool_run(grouser_pool *pool, grouser_share share, void *work) { run_alone(pool, share, work); }

void grouser_pool_stop(grouser_pool *pool) { (void)pool; }

#endif
